// Accessors: typed, possibly strided, normalized or sparse arrays in the buffers. Private to the glTF loader.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/gltf_document.h"
#include "core/vec.h"

namespace nephroid {

/// Which elements to read: all of them, or those listed.
struct ElementSelection {
    bool all = true;
    std::span<const uint32_t> elements;  ///< Below the accessor's count.
    size_t size(size_t count) const { return all ? count : elements.size(); }
};

/// Throws unless the accessor's type and range of bytes are valid.
void check_accessor(const GltfDocument& document, int accessor);

/// Reads `components` floats per selected element; integers are converted, normalized where the accessor says so.
/// Throws where the accessor has another number of components or holds values that are not finite.
void read_floats(const GltfDocument& document, int accessor, int components, const ElementSelection& selection,
                 float* out);

/// Converts `components` packed values of a glTF component type to floats; false where the type is not supported.
bool convert_components(int component_type, const uint8_t* bytes, int components, bool normalized, float* out);

/// Bytes of one value of a glTF component type; 0 where it is not supported.
size_t component_size(int component_type);

/// Reads an index array of unsigned integers; throws for the primitive restart value.
std::vector<uint32_t> read_indices(const GltfDocument& document, int accessor);

/// read_floats into vectors of the right size. `spare` more elements are reserved.
template <typename Vector>
std::vector<Vector> read_vectors(const GltfDocument& document, int accessor, const ElementSelection& selection,
                                 size_t spare = 0) {
    std::vector<Vector> result;
    const size_t size = selection.size(document.model.accessors[static_cast<size_t>(accessor)].count);
    result.reserve(size + spare);
    result.resize(size);
    if (size > 0) read_floats(document, accessor, Vector::length(), selection, &result[0][0]);
    return result;
}

}  // namespace nephroid
