#!/usr/bin/env python3
"""A dark room beside a bright one: all light comes through a slit in the wall, by two diffuse reflections and more.

After Veach's ajar door. The lamp is a panel on the bright side of that wall: its own light never passes the slit.
"""

import os
import sys

from gltf_writer import GltfBuilder
from shapes import box, quad, sphere

# Metres. The dark room is z > 0, the bright one z < -WALL; the slit goes through the wall between them.
HALF_WIDTH, HEIGHT, DEPTH = 2.0, 2.6, 5.0
BRIGHT_HALF_WIDTH, BRIGHT_DEPTH = 3.0, 2.0
WALL, SLIT_WIDTH, SLIT_HEIGHT, SLIT_X = 0.04, 0.6, 2.0, 0.6


def room(half_width: float, near: float, far: float):
    """Floor, ceiling and side walls between z = near > far, facing inwards; the ends are left open."""
    length = near - far
    return {
        "floor": quad((-half_width, 0, near), (2 * half_width, 0, 0), (0, 0, -length)),
        "ceiling": quad((-half_width, HEIGHT, far), (2 * half_width, 0, 0), (0, 0, length)),
        "left": quad((-half_width, 0, near), (0, 0, -length), (0, HEIGHT, 0)),
        "right": quad((half_width, 0, far), (0, 0, length), (0, HEIGHT, 0)),
    }


def wall_with_slit():
    """The wall between the rooms: three boxes around the slit, as (name, position of the bottom's centre, size)."""
    half = BRIGHT_HALF_WIDTH
    left, right = SLIT_X - SLIT_WIDTH / 2, SLIT_X + SLIT_WIDTH / 2
    return [
        ("wall left of the slit", ((left - half) / 2, 0, -WALL / 2), (left + half, HEIGHT, WALL)),
        ("wall right of the slit", ((right + half) / 2, 0, -WALL / 2), (half - right, HEIGHT, WALL)),
        ("lintel", (SLIT_X, SLIT_HEIGHT, -WALL / 2), (SLIT_WIDTH, HEIGHT - SLIT_HEIGHT, WALL)),
    ]


def add_rooms(builder: GltfBuilder) -> None:
    pale = builder.add_material("pale", (0.5, 0.5, 0.5), specular=0.0)
    grey = builder.add_material("grey", (0.12, 0.12, 0.12), specular=0.0)
    wood = builder.add_material("wood", (0.16, 0.12, 0.08), specular=0.0)
    blue = builder.add_material("blue", (0.09, 0.12, 0.18), specular=0.0)
    red = builder.add_material("red", (0.18, 0.08, 0.06), specular=0.0)
    dark = {"floor": wood, "ceiling": grey, "left": blue, "right": red}
    for prefix, parts in [("dark", room(HALF_WIDTH, DEPTH, 0)),
                          ("bright", room(BRIGHT_HALF_WIDTH, -WALL, -WALL - BRIGHT_DEPTH))]:
        for part, geometry in parts.items():
            material = dark[part] if prefix == "dark" else pale
            builder.add_node(f"{prefix} {part}", mesh=builder.add_mesh(f"{prefix} {part}", geometry, material))
    half = BRIGHT_HALF_WIDTH
    ends = [
        ("dark end", quad((HALF_WIDTH, 0, DEPTH), (-2 * HALF_WIDTH, 0, 0), (0, HEIGHT, 0)), grey),
        ("bright end", quad((-half, 0, -WALL - BRIGHT_DEPTH), (2 * half, 0, 0), (0, HEIGHT, 0)), pale),
    ]
    for name, geometry, material in ends:
        builder.add_node(name, mesh=builder.add_mesh(name, geometry, material))
    for name, position, size in wall_with_slit():
        builder.add_node(name, translation=position, mesh=builder.add_mesh(name, box(size), grey))


def add_things(builder: GltfBuilder) -> None:
    """What stands in the dark room."""
    plaster = builder.add_material("plaster", (0.4, 0.38, 0.34), specular=0.0)
    metal = builder.add_material("rough metal", (0.9, 0.75, 0.5), metallic=1.0, roughness=0.55)
    varnish = builder.add_material("varnish", (0.1, 0.16, 0.1), roughness=0.5)
    builder.add_node("table", translation=(-0.35, 0.001, 2.9), mesh=builder.add_mesh("table", box((1.0, 0.6, 0.7)), varnish))
    builder.add_node("plaster ball", translation=(-0.57, 0.851, 2.9),
                     mesh=builder.add_mesh("plaster ball", sphere(0.25, 48, 24), plaster))
    builder.add_node("metal ball", translation=(-0.05, 0.791, 2.8),
                     mesh=builder.add_mesh("metal ball", sphere(0.19, 48, 24), metal))


def build() -> GltfBuilder:
    builder = GltfBuilder()
    add_rooms(builder)
    add_things(builder)
    lamp = builder.add_material("lamp", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 0.9, 0.75), emission_strength=1000.0)
    builder.add_node("lamp", mesh=builder.add_mesh(
        "lamp", quad((2.7, 0.4, -WALL - 0.01), (-1.7, 0, 0), (0, 1.8, 0)), lamp))
    builder.add_perspective_camera("camera", (1.75, 1.6, 0.25), (-0.45, 0.75, 3.3), 0.95, 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    build().write(sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(__file__), "door_slit.glb"))
