"""Shapes for the scene generators. Lengths in metres; triangles are counter-clockwise seen from outside."""

from __future__ import annotations

import math

from gltf_writer import Geometry, GltfBuilder, cross, normalize, subtract


def quad(corner, edge_u, edge_v, with_uvs: bool = False) -> Geometry:
    """A parallelogram facing edge_u x edge_v; uv (0, 0) is at `corner`, (1, 1) opposite."""
    geometry = Geometry()
    normal = normalize(cross(edge_u, edge_v))
    for u, v in [(0, 0), (1, 0), (1, 1), (0, 1)]:
        position = [corner[c] + u * edge_u[c] + v * edge_v[c] for c in range(3)]
        geometry.add_vertex(position, normal, (u, v) if with_uvs else None)
    geometry.indices.extend([0, 1, 2, 0, 2, 3])
    return geometry


def floor(half_size: float, height: float = 0.0, with_uvs: bool = False) -> Geometry:
    """A horizontal square of 2 half_size, facing up."""
    side = 2.0 * half_size
    return quad((-half_size, height, half_size), (side, 0.0, 0.0), (0.0, 0.0, -side), with_uvs)


def merge(parts) -> Geometry:
    """One mesh of several that have the same attributes."""
    merged = Geometry()
    for part in parts:
        base = merged.vertex_count()
        merged.positions.extend(part.positions)
        merged.normals.extend(part.normals)
        merged.uvs.extend(part.uvs)
        merged.indices.extend(index + base for index in part.indices)
    return merged


def box(size) -> Geometry:
    """An axis-aligned box with flat normals; its bottom's centre is the origin."""
    x, y, z = size[0] / 2.0, size[1], size[2] / 2.0
    return merge([
        quad((-x, 0, z), (2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, -z), (-2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, z), (0, 0, -2 * z), (0, y, 0)),
        quad((-x, 0, -z), (0, 0, 2 * z), (0, y, 0)),
        quad((-x, y, z), (2 * x, 0, 0), (0, 0, -2 * z)),
        quad((-x, 0, -z), (2 * x, 0, 0), (0, 0, 2 * z)),
    ])


def add_grid(geometry: Geometry, first: int, columns: int, rows: int) -> None:
    """Two triangles for each cell of a grid of (columns + 1) x (rows + 1) vertices, leaving out those without area.

    The grid's column direction times its row direction points outwards.
    """
    for row in range(rows):
        for column in range(columns):
            a = first + row * (columns + 1) + column
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            for triangle in [(a, b, c), (a, c, d)]:
                if has_area(geometry, triangle):
                    geometry.indices.extend(triangle)


def has_area(geometry: Geometry, triangle) -> bool:
    corners = [geometry.positions[3 * index : 3 * index + 3] for index in triangle]
    area = cross(subtract(corners[1], corners[0]), subtract(corners[2], corners[0]))
    return max(abs(component) for component in area) > 1e-12


def sphere(radius: float, columns: int = 64, rows: int = 32) -> Geometry:
    """A sphere around the origin with exact smooth normals and latitude-longitude uvs."""
    geometry = Geometry()
    for row in range(rows + 1):
        # Exact poles: sin(pi) is not zero in floating point, and a sliver of a triangle would remain.
        theta = math.pi * row / rows
        sine = 0.0 if row in (0, rows) else math.sin(theta)
        for column in range(columns + 1):
            phi = 2.0 * math.pi * (column % columns) / columns
            normal = (sine * math.sin(phi), -math.cos(theta), sine * math.cos(phi))
            geometry.add_vertex([radius * n for n in normal], normal, (column / columns, row / rows))
    add_grid(geometry, 0, columns, rows)
    return geometry


def revolve(profile, columns: int) -> Geometry:
    """The closed ring that a closed profile sweeps around the Y axis.

    profile: (radius, height, normal_radius, normal_height) per vertex, counter-clockwise with radius to the right and
    height upwards.
    """
    geometry = Geometry()
    rows = len(profile)
    for column in range(columns):
        phi = 2.0 * math.pi * column / columns
        sine, cosine = math.sin(phi), math.cos(phi)
        for radius, height, normal_radius, normal_height in profile:
            geometry.add_vertex((radius * sine, height, radius * cosine),
                                (normal_radius * sine, normal_height, normal_radius * cosine))
    for column in range(columns):
        following = (column + 1) % columns
        for row in range(rows):
            above = (row + 1) % rows
            a, b = column * rows + row, following * rows + row
            c, d = following * rows + above, column * rows + above
            geometry.indices.extend([a, b, c, a, c, d])
    return geometry


def rounded_band_profile(inner: float, outer: float, bottom: float, top: float, bevel: float,
                         wall_cells: int, corner_cells: int):
    """Profile for `revolve`: a rectangle with round corners of radius `bevel`, finely divided along its walls."""
    profile = []

    def wall(start, end, normal):
        for step in range(1, wall_cells):
            t = step / wall_cells
            profile.append((start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]), *normal))

    def corner(centre, first_angle):
        for step in range(corner_cells + 1):
            angle = first_angle + 0.5 * math.pi * step / corner_cells
            normal = (math.cos(angle), math.sin(angle))
            profile.append((centre[0] + bevel * normal[0], centre[1] + bevel * normal[1], *normal))

    corner((outer - bevel, bottom + bevel), -0.5 * math.pi)
    wall((outer, bottom + bevel), (outer, top - bevel), (1.0, 0.0))
    corner((outer - bevel, top - bevel), 0.0)
    corner((inner + bevel, top - bevel), 0.5 * math.pi)
    wall((inner, top - bevel), (inner, bottom + bevel), (-1.0, 0.0))
    corner((inner + bevel, bottom + bevel), math.pi)
    return profile


def arc_band(profile, columns: int, angle: float) -> Geometry:
    """The part of `revolve`'s ring from 0 to `angle` radians (from +Z towards +X), closed by flat ends.

    The profile must be convex.
    """
    geometry = Geometry()
    rows = len(profile)
    # The first vertex is repeated, so that a grid closes around the profile.
    for row in range(rows + 1):
        radius, height, normal_radius, normal_height = profile[row % rows]
        for column in range(columns + 1):
            phi = angle * column / columns
            sine, cosine = math.sin(phi), math.cos(phi)
            geometry.add_vertex((radius * sine, height, radius * cosine),
                                (normal_radius * sine, normal_height, normal_radius * cosine))
    add_grid(geometry, 0, columns, rows)
    outline = [(radius, height) for radius, height, _, _ in profile]
    return merge([geometry, profile_cap(outline, 0.0, True), profile_cap(outline, angle, False)])


def profile_cap(outline, phi: float, start: bool) -> Geometry:
    """The flat end of an `arc_band` at the angle phi, as a fan around the mean of the outline."""
    geometry = Geometry()
    sine, cosine = math.sin(phi), math.cos(phi)
    side = -1.0 if start else 1.0
    normal = (side * cosine, 0.0, -side * sine)
    centre = [sum(point[c] for point in outline) / len(outline) for c in range(2)]
    for radius, height in [centre, *outline]:
        geometry.add_vertex((radius * sine, height, radius * cosine), normal)
    count = len(outline)
    for k in range(count):
        a, b = 1 + k, 1 + (k + 1) % count
        geometry.indices.extend((0, a, b) if start else (0, b, a))
    return geometry


class Waves:
    """A smooth bumpy function of two parameters: the sum of a few sines.

    terms: (amplitude, u frequency, v frequency, phase); frequencies in radians per unit of the parameter.
    """

    def __init__(self, terms) -> None:
        self.terms = list(terms)

    def __call__(self, u: float, v: float):
        """The value and its derivatives by u and v."""
        value = by_u = by_v = 0.0
        for amplitude, frequency_u, frequency_v, phase in self.terms:
            angle = frequency_u * u + frequency_v * v + phase
            value += amplitude * math.sin(angle)
            slope = amplitude * math.cos(angle)
            by_u += frequency_u * slope
            by_v += frequency_v * slope
        return value, by_u, by_v


def sheet(point, columns: int, rows: int, closed: bool = False) -> Geometry:
    """A surface over u, v in [0, 1]: point(u, v) gives the position and its derivatives by u and by v.

    It faces derivative by u x derivative by v; normals are exact. Where it is closed, u = 1 has the bits of u = 0.
    """
    geometry = Geometry()
    for row in range(rows + 1):
        for column in range(columns + 1):
            position, by_u, by_v = point((column % columns if closed else column) / columns, row / rows)
            geometry.add_vertex(position, normalize(cross(by_u, by_v)))
    add_grid(geometry, 0, columns, rows)
    return geometry


def bumpy_rectangle(width: float, height: float, waves: Waves, columns: int, rows: int) -> Geometry:
    """A rectangle around the origin in the plane z = 0 that faces +Z, displaced along Z by waves(x, y) in metres."""
    def point(u, v):
        x, y = (u - 0.5) * width, (v - 0.5) * height
        z, by_x, by_y = waves(x, y)
        return (x, y, z), (width, 0.0, width * by_x), (0.0, height, height * by_y)

    return sheet(point, columns, rows)


def add_leaning_plane(builder: GltfBuilder, size: float, waves: Waves, cells: int, colour, alpha: float,
                      lean: float, height: float) -> None:
    """A bumpy metal square that faces +Z and leans that way by `lean` degrees, and the Lambert floor below it.

    cells: along each side. alpha: the metal's GGX width. height: of its centre, for a lower edge just above the floor.
    """
    metal = builder.add_material("plane", colour, metallic=1.0, roughness=math.sqrt(alpha))
    lambert = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    plane = builder.add_mesh("plane", bumpy_rectangle(size, size, waves, cells, cells), metal)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(8.0), lambert))
    half = 0.5 * math.radians(lean)
    builder.add_node("plane", translation=(0.0, height, -0.6), mesh=plane,
                     rotation=(math.sin(half), 0.0, 0.0, math.cos(half)))


def bumpy_arc(radius: float, length: float, first_angle: float, last_angle: float, waves: Waves, columns: int,
              rows: int) -> Geometry:
    """A part of a cylinder around the Z axis, from first_angle to last_angle (radians from +X towards +Y).

    Its radius grows by waves(angle, z) metres. It faces outwards where first_angle < last_angle, else the axis.
    A full turn closes if the waves do: then their angular frequencies are whole numbers.
    """
    span = last_angle - first_angle

    def point(u, v):
        angle, z = first_angle + span * u, (v - 0.5) * length
        bump, by_angle, by_z = waves(angle, z)
        cosine, sine, r = math.cos(angle), math.sin(angle), radius + bump
        along = [span * (by_angle * cosine - r * sine), span * (by_angle * sine + r * cosine), 0.0]
        return (r * cosine, r * sine, z), along, [length * by_z * cosine, length * by_z * sine, length]

    return sheet(point, columns, rows, closed=abs(span) == 2.0 * math.pi)


def traced_sheet(position, columns: int, rows: int, closed: bool = False) -> Geometry:
    """Like `sheet`, for a surface of which only position(u, v) is known: derivatives are central differences.

    Where closed, position must have the period 1 in u. The ends of v are taken from inside.
    """
    step = 1e-4

    def difference(late, early, width):
        return [(a - b) / width for a, b in zip(late, early)]

    def point(u, v):
        by_u = difference(position(u + step, v), position(u - step, v), 2.0 * step)
        low, high = max(v - step, 0.0), min(v + step, 1.0)
        return position(u, v), by_u, difference(position(u, high), position(u, low), high - low)

    return sheet(point, columns, rows, closed)


def ellipsoid(centre, radii, columns: int, rows: int) -> Geometry:
    """An ellipsoid with its axes along X, Y and Z, and exact normals."""
    ball = sphere(1.0, columns, rows)
    result = Geometry()
    for k in range(ball.vertex_count()):
        unit = ball.positions[3 * k : 3 * k + 3]
        result.add_vertex([centre[c] + radii[c] * unit[c] for c in range(3)],
                          normalize([unit[c] / radii[c] for c in range(3)]))
    result.indices.extend(ball.indices)
    return result


def tube(spine, radius, columns: int, rows: int, across=(0.0, 0.0, 1.0)) -> Geometry:
    """A round tube about a curve: spine(v) in metres, radius(v, angle) in metres, v from 0 to 1.

    across: a direction that the curve never runs along; angles (radians) count from it. The ends stay open: let the
    radius go to nearly nothing there. (At nothing at all there is no normal.)
    """
    step = 1e-3

    def position(u, v):
        along = normalize(subtract(spine(v + step), spine(v - step)))
        up = normalize(cross(along, across))
        side = cross(up, along)
        angle = 2.0 * math.pi * u
        r = radius(v, angle)
        centre = spine(v)
        return tuple(centre[c] + r * (math.cos(angle) * side[c] + math.sin(angle) * up[c]) for c in range(3))

    # side x up = along: up, the angle's way, times along faces outwards.
    return traced_sheet(position, columns, rows, closed=True)
