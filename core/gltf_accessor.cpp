#include "core/gltf_accessor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "core/gltf_error.h"

namespace nephroid {

namespace {

/// Where the elements of an accessor lie. data is nullptr for an accessor without buffer view: all zeros.
struct ElementArray {
    const uint8_t* data = nullptr;
    size_t stride = 0;
    int component_type = 0;
    int components = 0;
    bool normalized = false;
};

const tinygltf::Accessor& get(const GltfDocument& document, int accessor) {
    return document.model.accessors[static_cast<size_t>(accessor)];
}

std::string name_of(int accessor) {
    return element_name("accessor", static_cast<size_t>(accessor));
}

int component_count(int type) {
    switch (type) {
        case TINYGLTF_TYPE_SCALAR:
            return 1;
        case TINYGLTF_TYPE_VEC2:
            return 2;
        case TINYGLTF_TYPE_VEC3:
            return 3;
        case TINYGLTF_TYPE_VEC4:
            return 4;
        default:
            return 0;
    }
}

/// Pointer to `count` elements at an offset in a buffer view, after checking that they are inside it.
const uint8_t* locate(const GltfDocument& document, int buffer_view, size_t offset, size_t count, size_t stride,
                      size_t element_size, const std::string& element) {
    const std::span<const uint8_t> bytes = buffer_view_bytes(document, buffer_view);
    // count is below 2^31 and stride below 2^8: no overflow.
    const size_t needed = count == 0 ? 0 : offset + (count - 1) * stride + element_size;
    if (needed > bytes.size()) {
        fail_gltf(document.file, element,
                  "it needs " + std::to_string(needed) + " bytes but buffer view " + std::to_string(buffer_view) +
                      " has " + std::to_string(bytes.size()) + "; re-export the file");
    }
    return bytes.data() + (count == 0 ? 0 : offset);
}

/// Checks everything but the sparse part.
ElementArray locate_elements(const GltfDocument& document, int index) {
    const tinygltf::Accessor& accessor = get(document, index);
    ElementArray result;
    result.component_type = accessor.componentType;
    result.components = component_count(accessor.type);
    result.normalized = accessor.normalized;
    const size_t size = component_size(accessor.componentType);
    if (size == 0) fail_gltf(document.file, name_of(index), "its component type is not supported; re-export the file");
    if (result.components == 0) fail_gltf(document.file, name_of(index), "matrices cannot be used here");
    const size_t element_size = size * static_cast<size_t>(result.components);
    result.stride = element_size;
    if (accessor.bufferView < 0) return result;
    const size_t stride = document.model.bufferViews[static_cast<size_t>(accessor.bufferView)].byteStride;
    if (stride != 0 && stride < element_size) {
        fail_gltf(document.file, name_of(index), "the byte stride of its buffer view is less than an element");
    }
    if (stride != 0) result.stride = stride;
    result.data = locate(document, accessor.bufferView, accessor.byteOffset, accessor.count, result.stride,
                         element_size, name_of(index));
    return result;
}

template <typename T>
T load(const uint8_t* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
}

template <typename T>
void convert_element(const uint8_t* bytes, int components, bool normalized, float* out) {
    for (int c = 0; c < components; ++c) {
        const T value = load<T>(bytes + static_cast<size_t>(c) * sizeof(T));
        if constexpr (std::is_same_v<T, float>) {
            out[c] = value;
        } else {
            const float number = static_cast<float>(value);
            // Signed types reach down to -max - 1, which stands for -1 as well.
            out[c] = normalized ? std::max(number / static_cast<float>(std::numeric_limits<T>::max()), -1.0F) : number;
        }
    }
}

template <typename T>
void convert_elements(const ElementArray& array, size_t count, const ElementSelection& selection, float* out) {
    const size_t size = selection.size(count);
    const auto components = static_cast<size_t>(array.components);
    for (size_t i = 0; i < size; ++i) {
        const size_t element = selection.all ? i : selection.elements[i];
        convert_element<T>(array.data + element * array.stride, array.components, array.normalized,
                           out + i * components);
    }
}

void convert_all(const ElementArray& array, size_t count, const ElementSelection& selection, float* out) {
    const size_t values = selection.size(count) * static_cast<size_t>(array.components);
    if (array.data == nullptr) {
        std::fill(out, out + values, 0.0F);
        return;
    }
    switch (array.component_type) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
            return convert_elements<int8_t>(array, count, selection, out);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return convert_elements<uint8_t>(array, count, selection, out);
        case TINYGLTF_COMPONENT_TYPE_SHORT:
            return convert_elements<int16_t>(array, count, selection, out);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return convert_elements<uint16_t>(array, count, selection, out);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
            return convert_elements<uint32_t>(array, count, selection, out);
        default:
            break;
    }
    const size_t packed = static_cast<size_t>(array.components) * sizeof(float);
    if (selection.all && array.stride == packed) {
        std::memcpy(out, array.data, values * sizeof(float));
    } else {
        convert_elements<float>(array, count, selection, out);
    }
}

/// The replaced elements of a sparse accessor.
struct SparseElements {
    std::vector<uint32_t> positions;  ///< Below the accessor's count.
    ElementArray values;
};

uint32_t load_index(const uint8_t* bytes, int component_type) {
    switch (component_type) {
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return load<uint8_t>(bytes);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return load<uint16_t>(bytes);
        default:
            return load<uint32_t>(bytes);
    }
}

bool is_index_type(int component_type) {
    return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
           component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
           component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

SparseElements locate_sparse(const GltfDocument& document, int index, const ElementArray& base) {
    const tinygltf::Accessor& accessor = get(document, index);
    const auto& sparse = accessor.sparse;
    const std::string element = name_of(index) + " sparse";
    const auto count = static_cast<size_t>(sparse.count);
    if (count > accessor.count) fail_gltf(document.file, element, "it has more elements than the accessor");
    if (!is_index_type(sparse.indices.componentType)) {
        fail_gltf(document.file, element, "its indices are not unsigned integers; re-export the file");
    }
    const size_t index_size = component_size(sparse.indices.componentType);
    const size_t element_size = component_size(base.component_type) * static_cast<size_t>(base.components);
    const uint8_t* indices = locate(document, sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset),
                                    count, index_size, index_size, element + " indices");
    SparseElements result;
    result.values = base;
    result.values.stride = element_size;
    result.values.data = locate(document, sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset),
                                count, element_size, element_size, element + " values");
    result.positions.resize(count);
    for (size_t i = 0; i < count; ++i) {
        result.positions[i] = load_index(indices + i * index_size, sparse.indices.componentType);
        if (result.positions[i] >= accessor.count) {
            fail_gltf(document.file, element,
                      "index " + std::to_string(result.positions[i]) + " is not below the accessor's count " +
                          std::to_string(accessor.count) + "; re-export the file");
        }
    }
    return result;
}

/// Overwrites the selected elements that a sparse accessor replaces.
void apply_sparse(const GltfDocument& document, int accessor, const ElementArray& base,
                  const ElementSelection& selection, float* out) {
    const SparseElements sparse = locate_sparse(document, accessor, base);
    std::unordered_map<uint32_t, size_t> replaced;
    for (size_t i = 0; i < sparse.positions.size(); ++i) replaced[sparse.positions[i]] = i;
    const auto components = static_cast<size_t>(base.components);
    const size_t size = selection.size(get(document, accessor).count);
    for (size_t i = 0; i < size; ++i) {
        const auto found = replaced.find(selection.all ? static_cast<uint32_t>(i) : selection.elements[i]);
        if (found == replaced.end()) continue;
        const auto chosen = static_cast<uint32_t>(found->second);
        convert_all(sparse.values, sparse.positions.size(), {false, std::span(&chosen, 1)}, out + i * components);
    }
}

}  // namespace

size_t component_size(int component_type) {
    switch (component_type) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return 1;
        case TINYGLTF_COMPONENT_TYPE_SHORT:
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return 2;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        case TINYGLTF_COMPONENT_TYPE_FLOAT:
            return 4;
        default:
            return 0;
    }
}

bool convert_components(int component_type, const uint8_t* bytes, int components, bool normalized, float* out) {
    if (component_size(component_type) == 0) return false;
    convert_all({bytes, 0, component_type, components, normalized}, 1, {}, out);
    return true;
}

void check_accessor(const GltfDocument& document, int accessor) {
    const ElementArray base = locate_elements(document, accessor);
    if (get(document, accessor).sparse.isSparse) locate_sparse(document, accessor, base);
}

void read_floats(const GltfDocument& document, int index, int components, const ElementSelection& selection,
                 float* out) {
    const tinygltf::Accessor& accessor = get(document, index);
    const ElementArray array = locate_elements(document, index);
    if (array.components != components) {
        fail_gltf(document.file, name_of(index),
                  "it has " + std::to_string(array.components) + " components where " + std::to_string(components) +
                      " are needed; re-export the file");
    }
    convert_all(array, accessor.count, selection, out);
    if (accessor.sparse.isSparse) apply_sparse(document, index, array, selection, out);
    const size_t values = selection.size(accessor.count) * static_cast<size_t>(components);
    for (size_t i = 0; i < values; ++i) {
        if (std::isfinite(out[i])) continue;
        const size_t position = i / static_cast<size_t>(components);
        fail_gltf(document.file, name_of(index),
                  "element " + std::to_string(selection.all ? position : selection.elements[position]) +
                      " is not finite; repair the mesh and re-export");
    }
}

std::vector<uint32_t> read_indices(const GltfDocument& document, int index) {
    const tinygltf::Accessor& accessor = get(document, index);
    const ElementArray array = locate_elements(document, index);
    if (array.components != 1 || !is_index_type(array.component_type)) {
        fail_gltf(document.file, name_of(index), "indices must be unsigned integer scalars; re-export the file");
    }
    std::vector<uint32_t> indices(accessor.count, 0);
    if (array.data != nullptr) {
        for (size_t i = 0; i < indices.size(); ++i) {
            indices[i] = load_index(array.data + i * array.stride, array.component_type);
        }
    }
    if (accessor.sparse.isSparse) {
        const SparseElements sparse = locate_sparse(document, index, array);
        for (size_t i = 0; i < sparse.positions.size(); ++i) {
            indices[sparse.positions[i]] =
                load_index(sparse.values.data + i * sparse.values.stride, array.component_type);
        }
    }
    const uint32_t restart = array.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 0xFFU
                             : array.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 0xFFFFU
                                                                                              : 0xFFFFFFFFU;
    if (std::find(indices.begin(), indices.end(), restart) != indices.end()) {
        fail_gltf(document.file, name_of(index),
                  "index " + std::to_string(restart) + " means primitive restart, which glTF forbids; re-export");
    }
    return indices;
}

}  // namespace nephroid
