#include "pathcut/receiver_spacing.h"

#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Search_traits_adapter.h>
#include <CGAL/Simple_cartesian.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <numeric>

namespace nephroid {

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;

/// Points are indices: where they are.
struct Positions {
    using key_type = uint32_t;
    using value_type = Point;
    using reference = const Point&;
    using category = boost::lvalue_property_map_tag;
    const std::vector<Point>* points;
    friend reference get(const Positions& positions, key_type i) { return (*positions.points)[i]; }
};

using Traits = CGAL::Search_traits_adapter<uint32_t, Positions, CGAL::Search_traits_3<Kernel>>;
using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;

bool are_alike(const Receiver& a, const Receiver& b) {
    return a.object == b.object && glm::dot(a.geometric_normal, b.geometric_normal) > merge_normal_cosine;
}

}  // namespace

std::vector<float> receiver_spacing(std::span<const Receiver> receivers, uint32_t neighbours) {
    std::vector<Point> points;
    points.reserve(receivers.size());
    for (const Receiver& receiver : receivers) {
        const Vec3d p(receiver.position);
        points.emplace_back(p.x, p.y, p.z);
    }
    std::vector<uint32_t> indices(receivers.size());
    std::iota(indices.begin(), indices.end(), 0U);
    const Traits traits(Positions{&points});
    Search::Tree tree(indices.begin(), indices.end(), Search::Splitter(), traits);
    if (!indices.empty()) tree.build();  // Otherwise the first search would, and searches are side by side.
    const Search::Distance distance(Positions{&points});
    std::vector<float> spacing(receivers.size(), 0.0F);
    tbb::parallel_for(size_t{0}, receivers.size(), [&](size_t i) {
        // It finds itself first.
        const Search nearest(tree, points[i], 4 * neighbours + 1, 0.0, true, distance);
        uint32_t found = 0;
        for (const auto& [other, squared] : nearest) {
            if (other == i || !are_alike(receivers[other], receivers[i])) continue;
            if (++found < neighbours) continue;
            spacing[i] = static_cast<float>(std::sqrt(squared));
            break;
        }
    });
    return spacing;
}

}  // namespace nephroid
