// The slope of a half vector against a shading normal, and how it changes: Newton's method, lobes and their warps all
// take it from here. F is double, float or FloatV.
//
//   C = (h.s, h.t) / (h.n),   dC_q = [q.dh - (q.dn) (h.n) - C_q (dn.h + n.dh)] / (h.n),   q = s, t   (Sec. 2, lobes.md)
//
// where (s, t) follows n in parallel transport: dq = -(q.dn) n. The length of h cancels, so that H = wi + wo serves as
// it is.
#pragma once

#include "core/frame.h"

namespace nephroid {

/// The unit direction from a vertex to a neighbour on a path.
template <class F>
struct Connection {
    Triple<F> direction;
    F inverse_distance;  ///< 1/m; zero at infinity: moving the vertex turns nothing.

    /// Change of the direction when the vertex moves by v, metres.
    Triple<F> turned_by_vertex(const Triple<F>& v) const {
        return (direction * dot(direction, v) - v) * inverse_distance;
    }
};

/// Slopes along s and t; or what they change by.
template <class F>
struct SlopePair {
    F c1, c2;
};

template <class F>
struct HalfVectorSlope {
    Frame<F> frame;      ///< n: unit shading normal; s, t: the tangents that slopes belong to.
    Triple<F> h;         ///< Of any length; h.n not zero.
    F inverse_h_n;       ///< 1 / (h.n)
    SlopePair<F> slope;  ///< C.

    /// dC for changes of h and n.
    SlopePair<F> derivative(const Triple<F>& dh, const Triple<F>& dn) const {
        const F common = (dot(dn, h) + dot(frame.n, dh)) * inverse_h_n;
        return {dot(frame.s, dh) * inverse_h_n - dot(frame.s, dn) - slope.c1 * common,
                dot(frame.t, dh) * inverse_h_n - dot(frame.t, dn) - slope.c2 * common};
    }
};

template <class F>
HalfVectorSlope<F> half_vector_slope(const Triple<F>& h, const Frame<F>& frame) {
    const F inverse_h_n = F(1.0F) / dot(h, frame.n);
    return {frame, h, inverse_h_n, {dot(h, frame.s) * inverse_h_n, dot(h, frame.t) * inverse_h_n}};
}

}  // namespace nephroid
