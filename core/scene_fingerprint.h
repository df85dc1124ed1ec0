// Fingerprints of everything in a scene that a picture depends on.
#pragma once

#include "core/fingerprint.h"
#include "core/scene.h"

namespace nephroid {

void add_scene(const Scene& scene, Fingerprint& fingerprint);
void add_camera(const Camera& camera, Fingerprint& fingerprint);

}  // namespace nephroid
