#include "core/gltf_document.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/gltf_check.h"
#include "core/gltf_error.h"
#include "core/gltf_file.h"

namespace nephroid {

namespace {

using Json = nlohmann::json;

constexpr const char* supported_extensions[] = {
    "KHR_lights_punctual",   "KHR_materials_emissive_strength", "KHR_materials_ior",    "KHR_materials_specular",
    "KHR_materials_unlit",   "KHR_materials_transmission",      "KHR_materials_volume", "KHR_texture_transform",
    "KHR_mesh_quantization", "KHR_draco_mesh_compression",
};

bool is_supported(const std::string& extension) {
    return std::any_of(std::begin(supported_extensions), std::end(supported_extensions),
                       [&](const char* name) { return extension == name; });
}

/// Parses the JSON text and checks all that can be checked without the buffers.
Json parse_json(std::string_view text, const std::string& file) {
    check_json_shape(text, file);
    Json json;
    try {
        json = Json::parse(text);
    } catch (const Json::exception& failure) {
        fail_gltf(file, "JSON", "it cannot be parsed: " + printable(failure.what()) + "; re-export the file");
    }
    check_gltf_structure(json, file);
    return json;
}

/// Removes and returns a member; an empty array where there is none.
Json take(Json& json, const char* key) {
    const auto found = json.find(key);
    if (found == json.end()) return Json::array();
    Json taken = std::move(*found);
    json.erase(found);
    return taken;
}

/// Erases all members of an object but those named.
template <size_t count>
void keep_members(Json& json, const char* const (&names)[count]) {
    for (auto member = json.begin(); member != json.end();) {
        const bool kept = std::find(std::begin(names), std::end(names), member.key()) != std::end(names);
        member = kept ? std::next(member) : json.erase(member);
    }
}

/// Erases what the loader does not read but tinygltf would copy, at a multiple of its size: extras but our own,
/// extensions that are not supported, and, below, unknown members of materials and attributes.
void prune_unread(Json& json) {
    static constexpr const char* known_extras[] = {"caustics", "densify", "radius"};
    if (json.is_object()) {
        const auto extras = json.find("extras");
        if (extras != json.end() && extras->is_object()) keep_members(*extras, known_extras);
        if (extras != json.end() && !extras->is_object()) json.erase(extras);
        const auto extensions = json.find("extensions");
        if (extensions != json.end() && extensions->is_object()) keep_members(*extensions, supported_extensions);
    }
    if (!json.is_structured()) return;
    for (Json& element : json) prune_unread(element);
}

void prune_primitive(Json& primitive) {
    static constexpr const char* known[] = {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"};
    keep_members(primitive["attributes"], known);
}

void prune_material(Json& material) {
    static constexpr const char* known[] = {"name",           "pbrMetallicRoughness", "normalTexture",
                                            "emissiveFactor", "emissiveTexture",      "alphaMode",
                                            "alphaCutoff",    "doubleSided",          "extensions"};
    static constexpr const char* known_inner[] = {"baseColorFactor", "baseColorTexture", "metallicFactor",
                                                  "roughnessFactor", "metallicRoughnessTexture"};
    keep_members(material, known);
    if (material.contains("pbrMetallicRoughness")) keep_members(material["pbrMetallicRoughness"], known_inner);
}

/// tinygltf cuts integers in extensions and extras to 32 bits; as floating-point numbers they keep their value.
void widen_large_integers(Json& json) {
    if (json.is_structured()) {
        for (Json& element : json) widen_large_integers(element);
    } else if (json.is_number_integer() && std::abs(json.get<double>()) > double{INT32_MAX}) {
        json = json.get<double>();
    }
}

/// tinygltf refuses index accessors without a buffer view, which Draco and sparse accessors have: they get a stand-in.
/// Returns the accessors that did.
std::vector<size_t> add_stand_in_views(Json& json) {
    std::vector<size_t> changed;
    if (!json.contains("accessors")) return changed;
    const size_t stand_in = json.contains("bufferViews") ? json["bufferViews"].size() : 0;
    Json& accessors = json["accessors"];
    for (size_t i = 0; i < accessors.size(); ++i) {
        if (accessors[i].contains("bufferView")) continue;
        accessors[i]["bufferView"] = stand_in;
        changed.push_back(i);
    }
    if (!changed.empty()) json["bufferViews"].push_back({{"buffer", 0}, {"byteLength", 1}});
    return changed;
}

tinygltf::Model parse_model(Json json, const std::string& file) {
    const std::vector<size_t> without_view = add_stand_in_views(json);
    prune_unread(json);
    if (json.contains("materials")) {
        for (Json& material : json["materials"]) prune_material(material);
    }
    if (json.contains("meshes")) {
        for (Json& mesh : json["meshes"]) {
            if (!mesh.contains("primitives")) continue;
            for (Json& primitive : mesh["primitives"]) prune_primitive(primitive);
        }
    }
    for (const char* key : {"materials", "nodes", "extensions"}) {
        if (json.contains(key)) widen_large_integers(json[key]);
    }
    const std::string text = json.dump();
    json = nullptr;
    if (text.size() > UINT32_MAX) fail_gltf(file, "JSON", "it is larger than 4 GiB; split the scene");
    tinygltf::TinyGLTF parser;
    tinygltf::Model model;
    std::string error;
    std::string warning;
    if (!parser.LoadASCIIFromString(&model, &error, &warning, text.c_str(), static_cast<unsigned>(text.size()), "")) {
        fail_gltf(file, "document", printable(error) + "; re-export the file");
    }
    for (const size_t accessor : without_view) model.accessors[accessor].bufferView = -1;
    if (!without_view.empty()) model.bufferViews.pop_back();
    return model;
}

std::vector<tinygltf::Image> parse_images(const Json& json) {
    std::vector<tinygltf::Image> images;
    for (const Json& entry : json) {
        tinygltf::Image image;
        image.uri = entry.value("uri", "");
        image.name = entry.value("name", "");
        image.bufferView = entry.value("bufferView", -1);
        images.push_back(std::move(image));
    }
    return images;
}

void load_buffers(GltfDocument& document, Json buffers, std::span<const uint8_t> binary) {
    document.loaded.resize(buffers.size());
    for (size_t i = 0; i < buffers.size(); ++i) {
        const std::string element = element_name("buffer", i);
        std::span<const uint8_t> bytes;
        if (buffers[i].contains("uri")) {
            document.loaded[i] = read_uri(buffers[i]["uri"].get_ref<const std::string&>(), document.file, element);
            buffers[i] = nullptr;  // A data URI is as large as what was decoded from it.
            bytes = document.loaded[i];
        } else {
            if (i != 0 || document.file_bytes.empty()) {
                fail_gltf(document.file, element, "it has no URI; re-export the file");
            }
            bytes = binary;
        }
        document.buffers.push_back(bytes);
    }
}

/// Shrinks each buffer to the length that the document gives it.
void check_buffer_lengths(GltfDocument& document, const std::vector<size_t>& lengths) {
    for (size_t i = 0; i < lengths.size(); ++i) {
        std::span<const uint8_t>& bytes = document.buffers[i];
        if (bytes.size() < lengths[i]) {
            fail_gltf(document.file, element_name("buffer", i),
                      "it needs " + std::to_string(lengths[i]) + " bytes but there are " +
                          std::to_string(bytes.size()) + "; re-export the file");
        }
        bytes = bytes.first(lengths[i]);
    }
}

void check_buffer_views(const GltfDocument& document) {
    for (size_t i = 0; i < document.model.bufferViews.size(); ++i) {
        buffer_view_bytes(document, static_cast<int>(i));
    }
}

void check_extensions(const GltfDocument& document, Warnings& warnings) {
    const tinygltf::Model& model = document.model;
    for (const std::string& name : model.extensionsRequired) {
        if (is_supported(name)) continue;
        fail_gltf(document.file, "extension " + printable(name),
                  "it is required but not supported; export the file without it");
    }
    const std::set<std::string> used(model.extensionsUsed.begin(), model.extensionsUsed.end());
    for (const std::string& name : used) {
        if (is_supported(name)) continue;
        warnings.push_back(document.file + ": extension " + printable(name) + ": it is not supported; ignored");
    }
}

void check_version(const GltfDocument& document) {
    const tinygltf::Asset& asset = document.model.asset;
    const bool needs_later = !asset.minVersion.empty() && asset.minVersion != "2.0";
    if (!asset.version.starts_with("2.") || needs_later) {
        fail_gltf(document.file, "asset",
                  "glTF version " + printable(needs_later ? asset.minVersion : asset.version) +
                      " is not supported; export glTF 2.0");
    }
}

}  // namespace

GltfDocument open_gltf(const std::string& path, Warnings& warnings) {
    GltfDocument document;
    document.file = path;
    document.file_bytes = read_gltf_bytes(path, path, "file");
    document.source_bytes = document.file_bytes.size();

    const bool binary_container = is_glb(document.file_bytes);
    GlbParts parts;
    if (binary_container) {
        parts = split_glb(document.file_bytes, path);
    } else {
        parts.json = {reinterpret_cast<const char*>(document.file_bytes.data()), document.file_bytes.size()};
    }
    Json json = parse_json(parts.json, path);
    if (!binary_container) std::vector<uint8_t>().swap(document.file_bytes);

    if (json.contains("animations")) warnings.push_back(path + ": animations: they are not supported; ignored");
    if (json.contains("skins"))
        warnings.push_back(path + ": skins: they are not supported; meshes keep their rest pose");
    json.erase("animations");
    json.erase("skins");
    const Json images = take(json, "images");
    Json buffers = take(json, "buffers");
    std::vector<size_t> lengths;
    for (const Json& buffer : buffers) lengths.push_back(buffer["byteLength"].get<size_t>());

    document.model = parse_model(std::move(json), path);
    document.model.images = parse_images(images);
    check_version(document);
    check_extensions(document, warnings);
    load_buffers(document, std::move(buffers), parts.binary);
    for (const std::vector<uint8_t>& bytes : document.loaded) document.source_bytes += bytes.size();
    check_buffer_lengths(document, lengths);
    check_buffer_views(document);
    return document;
}

std::span<const uint8_t> buffer_view_bytes(const GltfDocument& document, int buffer_view) {
    const tinygltf::BufferView& view = document.model.bufferViews[static_cast<size_t>(buffer_view)];
    const std::span<const uint8_t> buffer = document.buffers[static_cast<size_t>(view.buffer)];
    if (view.byteOffset > buffer.size() || view.byteLength > buffer.size() - view.byteOffset) {
        fail_gltf(document.file, element_name("buffer view", static_cast<size_t>(buffer_view)),
                  "it ends at byte " + std::to_string(view.byteOffset + view.byteLength) + " but buffer " +
                      std::to_string(view.buffer) + " has " + std::to_string(buffer.size()) + "; re-export the file");
    }
    return buffer.subspan(view.byteOffset, view.byteLength);
}

double number_or(const tinygltf::Value& object, const char* key, double fallback) {
    if (!object.Has(key)) return fallback;
    const tinygltf::Value& value = object.Get(key);
    return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

const tinygltf::Value* find_extension(const tinygltf::ExtensionMap& extensions, const char* name) {
    const auto found = extensions.find(name);
    return found == extensions.end() ? nullptr : &found->second;
}

}  // namespace nephroid
