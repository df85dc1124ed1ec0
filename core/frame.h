// Orthonormal frame about a normal, and the change between world and local directions (local z = normal).
#pragma once

#include "core/simd.h"

namespace nephroid {

template <class F>
struct Frame {
    Triple<F> s, t, n;

    Triple<F> to_local(const Triple<F>& v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
    Triple<F> to_world(const Triple<F>& v) const {
        return {s.x * v.x + t.x * v.y + n.x * v.z, s.y * v.x + t.y * v.y + n.y * v.z,
                s.z * v.x + t.z * v.y + n.z * v.z};
    }
};

/// A frame with the given unit normal as n; continuous except at n.z = 0 (Duff et al. 2017).
template <class F>
Frame<F> make_frame(const Triple<F>& n) {
    const F sign = select(n.z < F(0.0F), F(-1.0F), F(1.0F));
    const F a = F(-1.0F) / (sign + n.z);
    const F b = n.x * n.y * a;
    return {{F(1.0F) + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

}  // namespace nephroid
