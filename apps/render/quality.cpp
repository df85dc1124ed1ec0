#include "apps/render/quality.h"

#include "core/error.h"

namespace nephroid {

const std::vector<Quality>& qualities() {
    static const std::vector<Quality> all = {
        {"draft", 16, {"cached_points=3000"}},
        {"standard", 64, {}},
        {"final", 1024, {"cached_points=30000"}},
    };
    return all;
}

const Quality& quality_named(const std::string& name) {
    for (const Quality& quality : qualities()) {
        if (quality.name == name) return quality;
    }
    throw Error(ExitCode::usage, "--quality " + name + ": unknown; use draft, standard or final");
}

}  // namespace nephroid
