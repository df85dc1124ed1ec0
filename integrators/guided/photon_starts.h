// Where photons start: points of the reflectors, evenly over their area or more of them where earlier ones were of use.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pathcut/reflector_tree.h"

namespace nephroid {

class PhotonStarts {
  public:
    /// Evenly.
    explicit PhotonStarts(const ReflectorTree& reflectors);

    /// Around those of `useful` (triangles; at least one): in proportion to how many of them lie in a group of
    /// neighbouring triangles and the two groups beside it.
    PhotonStarts around(std::span<const uint32_t> useful) const;

    uint32_t triangle(float u) const;                                                          ///< u in [0, 1).
    float pdf(uint32_t triangle) const { return group_pdf_[triangle / triangles_per_group]; }  ///< 1/m^2.
    double total_area() const { return area_up_to_.empty() ? 0.0 : area_up_to_.back(); }       ///< m^2.

    /// What these starts find of that on average, where even ones, as many as found it, find one.
    double gain(std::span<const uint32_t> useful) const;

  private:
    static constexpr size_t triangles_per_group = 16;  ///< Next to each other in the reflector tree.

    std::vector<double> area_up_to_;         ///< Of the triangles up to each, m^2.
    std::vector<double> probability_up_to_;  ///< The same.
    std::vector<float> group_pdf_;           ///< Of a group's points, 1/m^2.
};

}  // namespace nephroid
