#include "core/gltf_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/gltf_error.h"

namespace nephroid {

namespace {

using Json = nlohmann::json;

// Each JSON object becomes up to 2 kB of parsed structures, each value up to 200 bytes.
constexpr size_t max_depth = 64;
constexpr size_t max_objects = size_t{1} << 19U;
constexpr size_t max_texts = 1000;
constexpr size_t max_values = size_t{1} << 23U;

enum class Kind { object, objects, array, number, numbers, count, small_count, text, texts, boolean };

struct TypeRule {
    const char* path;  ///< Keys with '/' between; '*' stands for every element of an array or object.
    Kind kind;
    size_t length = 0;  ///< With numbers: how many.
};

struct IndexRule {
    const char* path;
    const char* target;  ///< Path of the array that is indexed.
};

constexpr TypeRule type_rules[] = {
    {"asset", Kind::object},
    {"asset/version", Kind::text},
    {"asset/minVersion", Kind::text},
    {"extensionsUsed", Kind::texts},
    {"extensionsRequired", Kind::texts},
    {"extensions", Kind::object},
    {"extensions/KHR_lights_punctual", Kind::object},
    {"extensions/KHR_lights_punctual/lights", Kind::objects},
    {"extensions/KHR_lights_punctual/lights/*/type", Kind::text},
    {"extensions/KHR_lights_punctual/lights/*/name", Kind::text},
    {"extensions/KHR_lights_punctual/lights/*/color", Kind::numbers, 3},
    {"extensions/KHR_lights_punctual/lights/*/intensity", Kind::number},
    {"extensions/KHR_lights_punctual/lights/*/range", Kind::number},
    {"extensions/KHR_lights_punctual/lights/*/spot", Kind::object},
    {"extensions/KHR_lights_punctual/lights/*/spot/innerConeAngle", Kind::number},
    {"extensions/KHR_lights_punctual/lights/*/spot/outerConeAngle", Kind::number},
    {"scenes", Kind::objects},
    {"scenes/*/nodes", Kind::array},
    {"nodes", Kind::objects},
    {"nodes/*/name", Kind::text},
    {"nodes/*/children", Kind::array},
    {"nodes/*/matrix", Kind::numbers, 16},
    {"nodes/*/translation", Kind::numbers, 3},
    {"nodes/*/rotation", Kind::numbers, 4},
    {"nodes/*/scale", Kind::numbers, 3},
    {"nodes/*/extensions", Kind::object},
    {"nodes/*/extensions/KHR_lights_punctual", Kind::object},
    {"meshes", Kind::objects},
    {"meshes/*/name", Kind::text},
    {"meshes/*/primitives", Kind::objects},
    {"meshes/*/primitives/*/attributes", Kind::object},
    {"meshes/*/primitives/*/mode", Kind::small_count},
    {"meshes/*/primitives/*/extensions", Kind::object},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression", Kind::object},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/attributes", Kind::object},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/attributes/*", Kind::small_count},
    {"accessors", Kind::objects},
    {"accessors/*/byteOffset", Kind::count},
    {"accessors/*/componentType", Kind::small_count},
    {"accessors/*/count", Kind::small_count},
    {"accessors/*/type", Kind::text},
    {"accessors/*/normalized", Kind::boolean},
    {"accessors/*/sparse", Kind::object},
    {"accessors/*/sparse/count", Kind::small_count},
    {"accessors/*/sparse/indices", Kind::object},
    {"accessors/*/sparse/indices/byteOffset", Kind::small_count},
    {"accessors/*/sparse/indices/componentType", Kind::small_count},
    {"accessors/*/sparse/values", Kind::object},
    {"accessors/*/sparse/values/byteOffset", Kind::small_count},
    {"bufferViews", Kind::objects},
    {"bufferViews/*/byteOffset", Kind::count},
    {"bufferViews/*/byteLength", Kind::count},
    {"bufferViews/*/byteStride", Kind::small_count},
    {"buffers", Kind::objects},
    {"buffers/*/byteLength", Kind::count},
    {"buffers/*/uri", Kind::text},
    {"images", Kind::objects},
    {"images/*/uri", Kind::text},
    {"images/*/name", Kind::text},
    {"textures", Kind::objects},
    {"samplers", Kind::objects},
    {"samplers/*/magFilter", Kind::small_count},
    {"samplers/*/minFilter", Kind::small_count},
    {"samplers/*/wrapS", Kind::small_count},
    {"samplers/*/wrapT", Kind::small_count},
    {"cameras", Kind::objects},
    {"cameras/*/name", Kind::text},
    {"cameras/*/type", Kind::text},
    {"cameras/*/perspective", Kind::object},
    {"cameras/*/perspective/yfov", Kind::number},
    {"cameras/*/perspective/aspectRatio", Kind::number},
    {"cameras/*/perspective/znear", Kind::number},
    {"cameras/*/perspective/zfar", Kind::number},
    {"cameras/*/orthographic", Kind::object},
    {"cameras/*/orthographic/xmag", Kind::number},
    {"cameras/*/orthographic/ymag", Kind::number},
    {"cameras/*/orthographic/znear", Kind::number},
    {"cameras/*/orthographic/zfar", Kind::number},
    {"materials", Kind::objects},
    {"materials/*/name", Kind::text},
    {"materials/*/alphaMode", Kind::text},
    {"materials/*/alphaCutoff", Kind::number},
    {"materials/*/doubleSided", Kind::boolean},
    {"materials/*/emissiveFactor", Kind::numbers, 3},
    {"materials/*/pbrMetallicRoughness", Kind::object},
    {"materials/*/pbrMetallicRoughness/baseColorFactor", Kind::numbers, 4},
    {"materials/*/pbrMetallicRoughness/metallicFactor", Kind::number},
    {"materials/*/pbrMetallicRoughness/roughnessFactor", Kind::number},
    {"materials/*/normalTexture/scale", Kind::number},
    {"materials/*/extensions", Kind::object},
    {"materials/*/extensions/*", Kind::object},
    {"materials/*/extensions/KHR_materials_emissive_strength/emissiveStrength", Kind::number},
    {"materials/*/extensions/KHR_materials_ior/ior", Kind::number},
    {"materials/*/extensions/KHR_materials_specular/specularFactor", Kind::number},
    {"materials/*/extensions/KHR_materials_specular/specularColorFactor", Kind::numbers, 3},
};

// Texture slots share their properties: the paths of texture_rules continue those of texture_slots.
constexpr const char* texture_slots[] = {
    "materials/*/pbrMetallicRoughness/baseColorTexture",
    "materials/*/pbrMetallicRoughness/metallicRoughnessTexture",
    "materials/*/normalTexture",
    "materials/*/emissiveTexture",
};
constexpr TypeRule texture_rules[] = {
    {"", Kind::object},
    {"/texCoord", Kind::small_count},
    {"/extensions", Kind::object},
    {"/extensions/KHR_texture_transform", Kind::object},
    {"/extensions/KHR_texture_transform/offset", Kind::numbers, 2},
    {"/extensions/KHR_texture_transform/scale", Kind::numbers, 2},
    {"/extensions/KHR_texture_transform/rotation", Kind::number},
    {"/extensions/KHR_texture_transform/texCoord", Kind::small_count},
};

constexpr IndexRule index_rules[] = {
    {"scene", "scenes"},
    {"scenes/*/nodes/*", "nodes"},
    {"nodes/*/children/*", "nodes"},
    {"nodes/*/mesh", "meshes"},
    {"nodes/*/camera", "cameras"},
    {"nodes/*/extensions/KHR_lights_punctual/light", "extensions/KHR_lights_punctual/lights"},
    {"meshes/*/primitives/*/attributes/*", "accessors"},
    {"meshes/*/primitives/*/indices", "accessors"},
    {"meshes/*/primitives/*/material", "materials"},
    {"meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView", "bufferViews"},
    {"accessors/*/bufferView", "bufferViews"},
    {"accessors/*/sparse/indices/bufferView", "bufferViews"},
    {"accessors/*/sparse/values/bufferView", "bufferViews"},
    {"bufferViews/*/buffer", "buffers"},
    {"images/*/bufferView", "bufferViews"},
    {"textures/*/source", "images"},
    {"textures/*/sampler", "samplers"},
};

constexpr const char* required[] = {
    "asset",
    "asset/version",
    "meshes/*/primitives/*/attributes",
    "meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView",
    "meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/attributes",
    "accessors/*/componentType",
    "accessors/*/count",
    "accessors/*/type",
    "accessors/*/sparse/count",
    "accessors/*/sparse/indices",
    "accessors/*/sparse/indices/bufferView",
    "accessors/*/sparse/indices/componentType",
    "accessors/*/sparse/values",
    "accessors/*/sparse/values/bufferView",
    "bufferViews/*/buffer",
    "bufferViews/*/byteLength",
    "buffers/*/byteLength",
    "cameras/*/type",
    "extensions/KHR_lights_punctual/lights/*/type",
    "nodes/*/extensions/KHR_lights_punctual/light",
};

/// One step on the way to a value: a key, or a position in an array.
struct Step {
    std::string_view key;
    size_t index = 0;
};
using Trail = std::vector<Step>;

std::string singular(std::string_view key) {
    if (key == "meshes") return "mesh";
    if (key == "bufferViews") return "buffer view";
    if (key == "children") return "child";
    if (key.size() > 1 && key.back() == 's') return std::string(key.substr(0, key.size() - 1));
    return std::string(key);
}

/// "mesh 2 primitive 0 attributes.POSITION"
std::string describe(const Trail& trail) {
    std::string result;
    for (size_t i = 0; i < trail.size(); ++i) {
        const bool indexed = i + 1 < trail.size() && trail[i + 1].key.empty();
        if (indexed) {
            if (!result.empty()) result += ' ';
            result += singular(trail[i].key) + " " + std::to_string(trail[i + 1].index);
            ++i;
        } else {
            const bool after_key = i > 0 && !trail[i - 1].key.empty();
            if (!result.empty()) result += after_key ? '.' : ' ';
            result += printable(std::string(trail[i].key));
        }
    }
    return result.empty() ? "document" : result;
}

using Visitor = std::function<void(const Json*, const Trail&)>;

/// Calls visit for every value that the path matches; with nullptr where only the last key is missing.
void visit_path(const Json& value, std::string_view path, Trail& trail, const Visitor& visit) {
    const size_t slash = path.find('/');
    const std::string_view key = path.substr(0, slash);
    const bool last = slash == std::string_view::npos;
    const auto step = [&](const Json& child, Step taken) {
        trail.push_back(taken);
        if (last) {
            visit(&child, trail);
        } else {
            visit_path(child, path.substr(slash + 1), trail, visit);
        }
        trail.pop_back();
    };
    if (key == "*") {
        if (value.is_array()) {
            for (size_t i = 0; i < value.size(); ++i) step(value[i], {{}, i});
        } else if (value.is_object()) {
            for (auto it = value.begin(); it != value.end(); ++it) step(it.value(), {it.key(), 0});
        }
        return;
    }
    if (!value.is_object()) return;
    const auto found = value.find(key);
    if (found != value.end()) {
        step(*found, {key, 0});
    } else if (last) {
        trail.push_back({key, 0});
        visit(nullptr, trail);
        trail.pop_back();
    }
}

void visit_all(const Json& document, std::string_view path, const Visitor& visit) {
    Trail trail;
    visit_path(document, path, trail, visit);
}

bool is_float(const Json& value) {
    return value.is_number() && std::abs(value.get<double>()) <= double{std::numeric_limits<float>::max()};
}

bool is_count(const Json& value, uint64_t max) {
    return value.is_number_unsigned() && value.get<uint64_t>() <= max;
}

template <typename Predicate>
bool all_elements(const Json& value, Predicate predicate) {
    return value.is_array() && std::all_of(value.begin(), value.end(), predicate);
}

/// What a value of this kind has to be, in words; empty where it is.
std::string mismatch(const Json& value, const TypeRule& rule) {
    constexpr uint64_t max_small = std::numeric_limits<int32_t>::max();
    constexpr uint64_t max_count = uint64_t{1} << 48U;
    switch (rule.kind) {
        case Kind::object:
            return value.is_object() ? "" : "an object";
        case Kind::objects:
            return all_elements(value, [](const Json& e) { return e.is_object(); }) ? "" : "an array of objects";
        case Kind::array:
            return value.is_array() ? "" : "an array";
        case Kind::number:
            return is_float(value) ? "" : "a number in the range of a float";
        case Kind::numbers:
            return value.size() == rule.length && all_elements(value, is_float)
                       ? ""
                       : "an array of " + std::to_string(rule.length) + " numbers in the range of a float";
        case Kind::count:
            return is_count(value, max_count) ? "" : "a non-negative integer below 2^48";
        case Kind::small_count:
            return is_count(value, max_small) ? "" : "a non-negative integer below 2^31";
        case Kind::text:
            return value.is_string() ? "" : "a string";
        case Kind::texts:
            return value.size() <= max_texts && all_elements(value, [](const Json& e) { return e.is_string(); })
                       ? ""
                       : "an array of at most 1000 strings";
        case Kind::boolean:
            return value.is_boolean() ? "" : "true or false";
    }
    return {};
}

void check_type(const Json& document, const TypeRule& rule, const std::string& path, const std::string& file) {
    visit_all(document, path, [&](const Json* value, const Trail& trail) {
        if (value == nullptr) return;
        const std::string expected = mismatch(*value, rule);
        if (!expected.empty()) fail_gltf(file, describe(trail), "it must be " + expected + "; re-export the file");
    });
}

const Json* find_array(const Json& document, std::string_view path) {
    const Json* result = nullptr;
    visit_all(document, path, [&](const Json* value, const Trail&) { result = value; });
    return result;
}

void check_index(const Json& document, const IndexRule& rule, const std::string& path, const std::string& file) {
    const Json* target = find_array(document, rule.target);
    const size_t size = target == nullptr ? 0 : target->size();
    visit_all(document, path, [&](const Json* value, const Trail& trail) {
        if (value == nullptr) return;
        if (is_count(*value, std::numeric_limits<int32_t>::max()) && value->get<size_t>() < size) return;
        fail_gltf(file, describe(trail),
                  "the index " + printable(value->dump()) + " names none of the " + std::to_string(size) + " " +
                      rule.target + "; re-export the file");
    });
}

}  // namespace

void check_json_shape(std::string_view text, const std::string& file) {
    size_t depth = 0;
    size_t objects = 0;
    size_t values = 0;
    bool in_string = false;
    for (size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (in_string) {
            if (c == '\\') ++i;
            if (c == '"') in_string = false;
            continue;
        }
        if (c == '"') in_string = true;
        if (c == '{') ++objects;
        if (c == ',' || c == '[' || c == '{') ++values;
        if ((c == '[' || c == '{') && ++depth > max_depth) {
            fail_gltf(file, "JSON", "it is nested deeper than " + std::to_string(max_depth) + "; re-export the file");
        }
        if ((c == ']' || c == '}') && depth > 0) --depth;
    }
    if (objects > max_objects || values > max_values) {
        fail_gltf(file, "JSON",
                  "it has more than " + std::to_string(max_objects) + " objects or " + std::to_string(max_values) +
                      " values; merge nodes and meshes before exporting");
    }
}

void check_gltf_structure(const Json& document, const std::string& file) {
    if (!document.is_object()) fail_gltf(file, "JSON", "it is not an object; re-export the file");
    for (const TypeRule& rule : type_rules) check_type(document, rule, rule.path, file);
    for (const char* slot : texture_slots) {
        for (const TypeRule& rule : texture_rules) check_type(document, rule, std::string(slot) + rule.path, file);
        check_index(document, {"", "textures"}, std::string(slot) + "/index", file);
    }
    for (const IndexRule& rule : index_rules) check_index(document, rule, rule.path, file);
    const auto check_present = [&](const std::string& path) {
        visit_all(document, path, [&](const Json* value, const Trail& trail) {
            if (value == nullptr) fail_gltf(file, describe(trail), "it is missing; re-export the file");
        });
    };
    for (const char* path : required) check_present(path);
    for (const char* slot : texture_slots) check_present(std::string(slot) + "/index");
}

}  // namespace nephroid
