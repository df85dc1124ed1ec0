// --quality: samples and settings that go together, chosen by the curves of docs/guiding.md, "What a knob trades".
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace nephroid {

struct Quality {
    std::string name;
    uint32_t spp;                     ///< Where neither samples, time nor noise is limited.
    std::vector<std::string> guided;  ///< Assignments "key=value" of `guided`; others have nothing to trade.
};

/// Throws Error(usage) where there is none of that name.
const Quality& quality_named(const std::string& name);

}  // namespace nephroid
