// Holes of alpha-masked and alpha-blended materials, decided while a ray is traced. Scenes without such materials
// never reach this code.
#pragma once

#include "accel/embree.h"
#include "core/scene.h"

namespace nephroid {

struct AlphaFilterData {
    const Scene* scene = nullptr;
    const Mesh* mesh = nullptr;
    const Material* material = nullptr;
};

/// Makes a geometry's hits subject to its material's alpha: mask: a hole below the cutoff; blend: a hole with
/// probability 1 - alpha, decided by a hash of the ray and the triangle (each ray independently, so unbiased).
/// `data` must outlive the geometry.
void attach_alpha_filter(RTCGeometry geometry, AlphaFilterData& data);

}  // namespace nephroid
