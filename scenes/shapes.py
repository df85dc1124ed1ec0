"""Shapes for the scene generators. Lengths in metres; triangles are counter-clockwise seen from outside."""

from __future__ import annotations

import math

from gltf_writer import Geometry, cross, normalize, subtract


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
