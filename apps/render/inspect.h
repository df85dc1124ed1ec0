// --inspect x,y: how directions are sampled at what a pixel sees, as pictures (docs/formats.md).
#pragma once

#include <string>

#include "apps/render/options.h"
#include "integrators/guided/inspection.h"

namespace nephroid {

/// The vertex that the pixel's centre sees. Throws Error(usage) where directions are not sampled there.
InspectedVertex vertex_to_inspect(const Options& options, const RenderContext& context, const PixelRegion& crop);

/// Name of the EXR of a whole hemisphere for a first output.
std::string inspection_path(const std::string& output);

/// Makes the pictures and writes them beside `output`; tells on stderr how the density fits, unless quiet.
/// Throws Error(output_failed).
void inspect_vertex(const Options& options, const Parameters& parameters, const RenderContext& context,
                    const Integrator& integrator, const InspectedVertex& vertex, const std::string& output);

}  // namespace nephroid
