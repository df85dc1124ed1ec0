#include "pathcut/receiver_tree.h"

#include <cmath>

#include "pathcut/bounding.h"

namespace nephroid {

ReceiverTree build_receiver_tree(std::span<const Vec3> points) {
    std::vector<uint32_t> finite;
    std::vector<OrderKey> keys;
    for (size_t i = 0; i < points.size(); ++i) {
        const Vec3& p = points[i];
        if (!std::isfinite(p.x + p.y + p.z)) continue;
        finite.push_back(static_cast<uint32_t>(i));
        keys.push_back({p.x, p.y, p.z, 0.0F, 0.0F, 0.0F});
    }
    ReceiverTree result;
    result.given = points.size();
    std::vector<Vec3> ordered;
    for (const uint32_t i : compact_order(keys)) {
        result.order.push_back(finite[i]);
        ordered.push_back(points[finite[i]]);
    }
    const std::span<const Vec3> all(ordered);
    result.tree = build_block_tree<PointBlock>(ordered.size(), [&](size_t begin, size_t end) {
        if (end - begin == 1) return PointBound<float>{to_triple(all[begin]), 0.0F};
        return bounding_sphere(all.subspan(begin, end - begin));
    });
    return result;
}

}  // namespace nephroid
