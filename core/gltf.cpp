#include "core/gltf.h"

#include "core/gltf_error.h"
#include "core/gltf_import.h"
#include "core/gltf_node.h"

namespace nephroid {

void warn_gltf(GltfImport& import, const std::string& element, const std::string& problem) {
    constexpr size_t max_warnings = 200;
    if (import.warned.size() > max_warnings) return;
    std::string line = import.document.file + ": " + element + ": " + problem;
    if (import.warned.size() == max_warnings) line = import.document.file + ": warnings: more of them are not shown";
    if (import.warned.insert(line).second) import.scene.warnings.push_back(line);
}

void charge_mesh_memory(GltfImport& import, size_t bytes, const std::string& element) {
    constexpr size_t always_allowed = size_t{1} << 29U;
    constexpr size_t largest_ratio = 32;
    import.mesh_bytes += bytes;
    if (import.mesh_bytes > always_allowed + largest_ratio * import.document.source_bytes) {
        fail_gltf(import.document.file, element,
                  "the meshes take too much memory for a file of this size; check its counts or split the scene");
    }
}

Scene load_gltf(const std::string& path) {
    GltfImport import;
    import.document = open_gltf(path, import.scene.warnings);
    import.scene.file = path;
    import_nodes(import);
    return std::move(import.scene);
}

}  // namespace nephroid
