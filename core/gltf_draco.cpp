#include "core/gltf_draco.h"

#include <draco/compression/decode.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>

#include <cmath>
#include <cstring>

#include "core/gltf_accessor.h"
#include "core/gltf_error.h"

namespace nephroid {

namespace {

constexpr const char* extension_name = "KHR_draco_mesh_compression";

[[noreturn]] void fail_malformed(const GltfImport& import, const std::string& element, const std::string& what) {
    fail_gltf(import.document.file, element, "its Draco data are malformed (" + what + "); re-export the file");
}

/// Sizes that a Draco stream announces, read before the decoder allocates memory for them.
struct AnnouncedSizes {
    uint32_t faces = 0;
    uint32_t points = 0;
};

bool read_announced_sizes(std::span<const uint8_t> bytes, AnnouncedSizes& sizes) {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::array<char, 5> magic{};
    uint8_t major = 0;
    uint8_t minor = 0;
    uint8_t geometry = 0;
    uint8_t method = 0;
    uint16_t flags = 0;
    if (!buffer.Decode(magic.data(), magic.size()) || std::memcmp(magic.data(), "DRACO", magic.size()) != 0) {
        return false;
    }
    if (!buffer.Decode(&major) || !buffer.Decode(&minor) || !buffer.Decode(&geometry) || !buffer.Decode(&method) ||
        !buffer.Decode(&flags)) {
        return false;
    }
    // The extension asks for bitstream 2.2; older ones are laid out in another way.
    if (major != draco::kDracoMeshBitstreamVersionMajor || minor != draco::kDracoMeshBitstreamVersionMinor)
        return false;
    if (geometry != draco::TRIANGULAR_MESH) return false;
    buffer.set_bitstream_version(draco::kDracoMeshBitstreamVersion);
    if ((flags & METADATA_FLAG_MASK) != 0) {
        draco::GeometryMetadata metadata;
        if (!draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata)) return false;
    }
    if (method == draco::MESH_EDGEBREAKER_ENCODING) {
        uint8_t traversal = 0;
        return buffer.Decode(&traversal) && draco::DecodeVarint(&sizes.points, &buffer) &&
               draco::DecodeVarint(&sizes.faces, &buffer);
    }
    return draco::DecodeVarint(&sizes.faces, &buffer) && draco::DecodeVarint(&sizes.points, &buffer);
}

void check_announced_sizes(GltfImport& import, std::span<const uint8_t> bytes, const std::string& element) {
    AnnouncedSizes sizes;
    if (!read_announced_sizes(bytes, sizes)) fail_malformed(import, element, "no mesh of bitstream version 2.2");
    // Rough upper bound of what the decoder's connectivity and attributes take while it runs.
    constexpr size_t bytes_per_face = 150;
    constexpr size_t bytes_per_point = 100;
    constexpr size_t always_allowed = size_t{1} << 29U;
    constexpr size_t largest_ratio = 256;
    const size_t expected = sizes.faces * bytes_per_face + sizes.points * bytes_per_point;
    if (expected > always_allowed + bytes.size() * largest_ratio) {
        fail_malformed(
            import, element,
            "it announces " + std::to_string(sizes.faces) + " triangles in " + std::to_string(bytes.size()) + " bytes");
    }
}

std::unique_ptr<draco::Mesh> decode_stream(const GltfImport& import, std::span<const uint8_t> bytes,
                                           const std::string& element) {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) fail_malformed(import, element, printable(decoded.status().error_msg_string()));
    std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
    if (mesh == nullptr) fail_malformed(import, element, "no mesh");
    return mesh;
}

std::vector<uint32_t> copy_indices(const GltfImport& import, const draco::Mesh& mesh, const std::string& element) {
    std::vector<uint32_t> indices;
    indices.reserve(size_t{mesh.num_faces()} * 3);
    for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face) {
        for (const draco::PointIndex& point : mesh.face(face)) {
            if (point.value() >= mesh.num_points()) fail_malformed(import, element, "index out of range");
            indices.push_back(point.value());
        }
    }
    return indices;
}

int gltf_component_type(draco::DataType type) {
    switch (type) {
        case draco::DT_INT8:
            return TINYGLTF_COMPONENT_TYPE_BYTE;
        case draco::DT_UINT8:
            return TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
        case draco::DT_INT16:
            return TINYGLTF_COMPONENT_TYPE_SHORT;
        case draco::DT_UINT16:
            return TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
        case draco::DT_UINT32:
            return TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
        case draco::DT_FLOAT32:
            return TINYGLTF_COMPONENT_TYPE_FLOAT;
        default:
            return 0;
    }
}

std::vector<float> copy_attribute(const GltfImport& import, const draco::Mesh& mesh,
                                  const draco::PointAttribute& attribute, int components, bool normalized,
                                  const std::string& element) {
    const int type = gltf_component_type(attribute.data_type());
    if (attribute.num_components() != components || attribute.buffer() == nullptr || component_size(type) == 0) {
        fail_malformed(import, element, "an attribute has another type or number of components than needed");
    }
    const auto value_bytes = static_cast<int64_t>(component_size(type)) * components;
    const auto available = static_cast<int64_t>(attribute.buffer()->data_size());
    const bool mapped = !attribute.is_mapping_identity();
    if (mapped && attribute.indices_map_size() < mesh.num_points()) fail_malformed(import, element, "no point map");

    std::vector<float> values(size_t{mesh.num_points()} * static_cast<size_t>(components));
    for (uint32_t point = 0; point < mesh.num_points(); ++point) {
        const draco::AttributeValueIndex entry = attribute.mapped_index(draco::PointIndex(point));
        const int64_t offset = attribute.GetBytePos(entry);
        if (offset < 0 || offset + value_bytes > available) fail_malformed(import, element, "value out of range");
        float* out = values.data() + size_t{point} * static_cast<size_t>(components);
        convert_components(type, attribute.buffer()->data() + offset, components, normalized, out);
        for (int c = 0; c < components; ++c) {
            if (!std::isfinite(out[c])) fail_malformed(import, element, "an attribute is not finite");
        }
    }
    return values;
}

DracoPrimitive convert_mesh(const GltfImport& import, const tinygltf::Primitive& primitive, const draco::Mesh& mesh,
                            const std::map<std::string, int>& components, const std::string& element) {
    DracoPrimitive result;
    result.vertex_count = mesh.num_points();
    result.indices = copy_indices(import, mesh, element);
    const tinygltf::Value& ids = primitive.extensions.at(extension_name).Get("attributes");
    for (const auto& [name, count] : components) {
        const auto accessor = primitive.attributes.find(name);
        if (!ids.Has(name) || accessor == primitive.attributes.end()) continue;
        const auto id = static_cast<uint32_t>(ids.Get(name).GetNumberAsInt());
        const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
        if (attribute == nullptr) fail_malformed(import, element, "there is no attribute " + std::to_string(id));
        const bool normalized = import.document.model.accessors[static_cast<size_t>(accessor->second)].normalized ||
                                attribute->normalized();
        result.attributes[name] = copy_attribute(import, mesh, *attribute, count, normalized, element);
    }
    return result;
}

}  // namespace

bool has_draco(const tinygltf::Primitive& primitive) {
    return find_extension(primitive.extensions, extension_name) != nullptr;
}

DracoPrimitive decode_draco(GltfImport& import, const tinygltf::Primitive& primitive,
                            const std::map<std::string, int>& components, const std::string& element) {
    const tinygltf::Value& extension = primitive.extensions.at(extension_name);
    const std::span<const uint8_t> bytes =
        buffer_view_bytes(import.document, extension.Get("bufferView").GetNumberAsInt());
    try {
        check_announced_sizes(import, bytes, element);
        const std::unique_ptr<draco::Mesh> mesh = decode_stream(import, bytes, element);
        return convert_mesh(import, primitive, *mesh, components, element);
    } catch (const std::bad_alloc&) {
        fail_malformed(import, element, "out of memory");
    } catch (const std::length_error&) {
        fail_malformed(import, element, "an array is too large");
    }
}

}  // namespace nephroid
