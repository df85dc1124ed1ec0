// Position and normals at a point of a triangle, for one hit or a vector of hits.
#pragma once

#include "core/rounding.h"
#include "core/simd.h"

namespace nephroid {

/// A triangle's corners and vertex normals (zero where the mesh has none), world space.
template <class F>
struct TriangleCorners {
    Triple<F> p0, p1, p2;
    Triple<F> n0, n1, n2;
};

template <class F>
struct SurfaceGeometry {
    Triple<F> position;
    Triple<F> error;             ///< Bound of |position - true position on the triangle|, per coordinate.
    Triple<F> geometric_normal;  ///< Unit, on the side of wo; zero for a degenerate triangle.
    Triple<F> shading_normal;    ///< Unit, interpolated, on neither side in particular; geometric where there is none.
    F double_area;               ///< Length of the corners' cross product.
    MaskOf<F> front;             ///< wo lies on the side that the winding calls front.
};

/// At barycentric weights u, v of corners 1 and 2, seen from direction wo.
template <class F>
SurfaceGeometry<F> interpolate_surface(const TriangleCorners<F>& c, const F& u, const F& v, const Triple<F>& wo) {
    SurfaceGeometry<F> g;
    const F w = F(1.0F) - u - v;
    const Triple<F> a = c.p0 * w;
    const Triple<F> b = c.p1 * u;
    const Triple<F> d = c.p2 * v;
    g.position = a + b + d;
    // Interpolation rounds relative to its terms; Embree's plane test relative to the corners' distance.
    const Triple<F> extent =
        maximum(absolute(c.p0 - g.position), maximum(absolute(c.p1 - g.position), absolute(c.p2 - g.position)));
    g.error = (absolute(a) + absolute(b) + absolute(d) + extent) * F(rounding_bound(8));

    const Triple<F> normal = cross(c.p1 - c.p0, c.p2 - c.p0);
    const F length2 = dot(normal, normal);
    g.double_area = square_root(length2);
    const F inverse = select(g.double_area > F(0.0F), F(1.0F) / g.double_area, F(0.0F));
    g.front = dot(normal, wo) >= F(0.0F);
    g.geometric_normal = normal * select(g.front, inverse, -inverse);

    const Triple<F> n = c.n0 * w + c.n1 * u + c.n2 * v;
    const F n_length2 = dot(n, n);
    g.shading_normal = select<F>(n_length2 > F(0.0F), n * (F(1.0F) / square_root(n_length2)), g.geometric_normal);
    return g;
}

/// The shading normal on the side of the geometric one.
template <class F>
Triple<F> face_forward(const Triple<F>& shading_normal, const Triple<F>& geometric_normal) {
    return select<F>(dot(shading_normal, geometric_normal) < F(0.0F), -shading_normal, shading_normal);
}

}  // namespace nephroid
