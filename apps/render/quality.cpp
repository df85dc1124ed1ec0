#include "apps/render/quality.h"

#include "core/error.h"

namespace nephroid {

const Quality& quality_named(const std::string& name) {
    static const std::vector<Quality> qualities = {
        {"draft", 16, {"cached_points=3000", "refinements=1"}},
        {"standard", 64, {}},
        {"final", 1024, {"cached_points=30000", "refinements=4"}},
    };
    for (const Quality& quality : qualities) {
        if (quality.name == name) return quality;
    }
    throw Error(ExitCode::usage, "--quality " + name + ": unknown; use draft, standard or final");
}

}  // namespace nephroid
