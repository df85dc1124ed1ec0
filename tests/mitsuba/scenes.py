#!/usr/bin/env python3
"""The comparison scenes: small glTF files that together cover every material, light, texture and camera feature.

Usage: scenes.py FOLDER writes them all, for a look.
"""

from __future__ import annotations

import math
import os
import sys
from dataclasses import dataclass
from typing import Callable

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))

import cornell  # noqa: E402
from gltf_writer import (CLAMP_TO_EDGE, LINEAR, MIRRORED_REPEAT, NEAREST, REPEAT, GltfBuilder, encode_png)  # noqa: E402
from shapes import box, floor, quad, sphere  # noqa: E402

ASPECT = 4.0 / 3.0
ENVIRONMENT = "environment.exr"


@dataclass
class ComparisonScene:
    """One scene and how much work its comparison needs."""

    name: str
    what: str
    build: Callable[[], GltfBuilder]
    max_depth: int  # surface scatterings
    our_spp: int  # per seed
    mitsuba_spp: int  # per seed
    environment: bool = False


# ---- parts

def turn(axis: str, degrees: float):
    """Quaternion (x, y, z, w) of a rotation about a coordinate axis."""
    half = math.radians(degrees) / 2.0
    part = math.sin(half)
    return (part if axis == "x" else 0.0, part if axis == "y" else 0.0, part if axis == "z" else 0.0, math.cos(half))


def stage(builder: GltfBuilder, position=(0.4, 1.5, 2.9), target=(0.0, 0.45, 0.0), fov: float = 42.0) -> None:
    builder.add_perspective_camera("camera", position, target, math.radians(fov), ASPECT)


def place(builder: GltfBuilder, name: str, geometry, material: int, **transform) -> int:
    return builder.add_node(name, mesh=builder.add_mesh(name, geometry, material), **transform)


def wall(height: float = 2.0):
    """A wall behind the stage, facing the camera."""
    return quad((-1.5, 0.0, -1.2), (3.0, 0.0, 0.0), (0.0, height, 0.0))


def picture(width: int, height: int, colour: Callable[[int, int], tuple]) -> bytes:
    """A PNG whose pixel (x, y), y downwards, has the 8-bit RGB values colour(x, y)."""
    return encode_png(width, height, bytes(c for y in range(height) for x in range(width) for c in colour(x, y)))


def patchwork(x: int, y: int) -> tuple:
    """Different in every texel, and without symmetry."""
    return ((53 * x + 29 * y + 40) % 216 + 30, (31 * x + 97 * y + 11) % 216 + 30, (71 * x + 13 * y + 90) % 216 + 30)


def grey(builder: GltfBuilder, value: float = 0.6) -> int:
    return builder.add_material("grey", (value, value, value), specular=0.0)


# ---- scenes

def lambert_point() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    place(builder, "floor", floor(1.5), grey(builder))
    place(builder, "wall", wall(), builder.add_material("red", (0.7, 0.15, 0.1), specular=0.0))
    blue = builder.add_material("blue", (0.1, 0.25, 0.7), specular=0.0)
    place(builder, "block", box((0.6, 0.7, 0.6)), blue, translation=(-0.3, 0.001, -0.2), rotation=turn("y", 25))
    builder.add_light("lamp", "point", 8.0, (1.0, 0.9, 0.7), position=(1.0, 1.6, 1.0))
    return builder


def coat_rough_directional() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    coated = builder.add_material("coated", (0.6, 0.5, 0.3), roughness=0.6)
    tinted = builder.add_material("tinted", (0.1, 0.3, 0.2), roughness=0.45, ior=1.9, specular=0.8,
                                  specular_color=(1.0, 0.5, 0.2))
    place(builder, "floor", floor(1.5), coated)
    place(builder, "block", box((0.8, 0.8, 0.8)), tinted, translation=(-0.1, 0.001, -0.2), rotation=turn("y", 35))
    builder.add_light("sun", "directional", 3.0, (1.0, 0.95, 0.8), position=(0, 5, 0), target=(0.6, 3.6, -1.2))
    return builder


def coat_smooth_sphere_light() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    place(builder, "floor", floor(1.5), builder.add_material("coated", (0.2, 0.25, 0.5), roughness=0.3))
    place(builder, "wall", wall(), grey(builder))
    builder.add_light("bulb", "point", 3.0, (1.0, 0.8, 0.6), position=(-0.4, 0.75, -0.3), radius=0.2)
    return builder


def metal_rough_spot() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    place(builder, "floor", floor(1.5), grey(builder))
    gold = builder.add_material("gold", (1.0, 0.75, 0.3), metallic=1.0, roughness=0.65)
    place(builder, "block", box((0.7, 0.6, 0.7)), gold, translation=(0.2, 0.001, -0.2), rotation=turn("y", -30))
    builder.add_light("spot", "spot", 14.0, (0.9, 0.9, 1.0), position=(-1.2, 2.0, 1.3), target=(0.1, 0.2, -0.1),
                      inner_angle=math.radians(12.0), outer_angle=math.radians(28.0))
    return builder


def metal_glossy_lamps() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    copper = builder.add_material("copper", (0.95, 0.64, 0.54), metallic=1.0, roughness=0.35)
    place(builder, "floor", floor(1.5), copper)
    place(builder, "wall", wall(), grey(builder, 0.4))
    texture = builder.add_texture("glow", picture(4, 4, patchwork), CLAMP_TO_EDGE, CLAMP_TO_EDGE)
    screen = builder.add_material("screen", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 0.9, 0.8),
                                  emission_strength=6.0, emissive_texture=builder.texture_slot(texture))
    place(builder, "screen", quad((-0.9, 0.3, -0.8), (0.9, 0.0, 0.2), (0.0, 0.7, 0.1), with_uvs=True), screen)
    panel = builder.add_material("panel", (0.2, 0.2, 0.2), specular=0.0, emission=(0.2, 0.5, 1.0),
                                 emission_strength=4.0, double_sided=True)
    place(builder, "panel", quad((0.7, 0.2, -0.4), (-0.35, 0.0, 0.25), (0.0, 0.4, 0.0)), panel)
    return builder


def mixed_metallic_environment() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    # Green: roughness, blue: metallic; red means nothing and must not matter.
    texture = builder.add_texture("rough metal", picture(4, 4, lambda x, y: (
        255 * (x % 2), 130 + 30 * ((x + y) % 4), 60 + 60 * ((x + 2 * y) % 4))), REPEAT, REPEAT)
    mixed = builder.add_material("mixed", (0.8, 0.5, 0.25), metallic=1.0, roughness=1.0,
                                 metallic_roughness_texture=builder.texture_slot(texture))
    half = builder.add_material("half", (0.3, 0.7, 0.4), metallic=0.5, roughness=0.5)
    place(builder, "floor", quad((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3), with_uvs=True), mixed)
    place(builder, "block", box((0.6, 0.6, 0.6)), half, translation=(0.1, 0.001, -0.1), rotation=turn("y", 20))
    return builder


def mirrors() -> GltfBuilder:
    builder = GltfBuilder()
    stage(builder)
    place(builder, "floor", floor(1.5), builder.add_material("polished", (0.5, 0.3, 0.2), roughness=0.0))
    white_mirror = builder.add_material("mirror", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)
    place(builder, "wall", wall(), white_mirror)
    tinted = builder.add_material("tinted mirror", (0.9, 0.5, 0.3), metallic=1.0, roughness=0.005)
    place(builder, "block", box((0.4, 0.5, 0.4)), tinted, translation=(-0.6, 0.001, -0.4), rotation=turn("y", 35))
    place(builder, "grey block", box((0.4, 0.4, 0.4)), grey(builder), translation=(0.4, 0.001, -0.1),
          rotation=turn("y", 10))
    lamp = builder.add_material("lamp", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 0.9, 0.7), emission_strength=5.0)
    place(builder, "lamp", quad((-0.5, 1.7, -0.4), (1.0, 0, 0), (0, 0, 0.8)), lamp)
    builder.add_light("point", "point", 1.5, position=(0.9, 1.2, 1.1))
    return builder


def textures() -> GltfBuilder:
    """Four panels: every wrap mode, transform and filter."""
    builder = GltfBuilder()
    stage(builder, (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 38.0)
    png = picture(4, 4, patchwork)
    panels = [
        ("repeat", (-1.2, 0.05), REPEAT, REPEAT, {"offset": (0.3, -0.2), "scale": (2.0, 3.0)}, LINEAR),
        ("mirror", (0.05, 0.05), MIRRORED_REPEAT, MIRRORED_REPEAT, {"rotation": 0.5, "scale": (2.5, 1.5)}, LINEAR),
        ("clamp", (-1.2, -0.95), CLAMP_TO_EDGE, CLAMP_TO_EDGE,
         {"offset": (-0.4, 0.3), "rotation": -0.3, "scale": (1.8, 1.4)}, LINEAR),
        ("mixed", (0.05, -0.95), REPEAT, MIRRORED_REPEAT, {"offset": (0.1, 0.6), "scale": (1.7, 2.6)}, NEAREST),
    ]
    for name, corner, wrap_u, wrap_v, transform, filter_mode in panels:
        texture = builder.add_texture(name, png, wrap_u, wrap_v, filter_mode)
        material = builder.add_material(name, (1.0, 0.9, 0.8), specular=0.0,
                                        base_color_texture=builder.texture_slot(texture, **transform))
        place(builder, name, quad((*corner, 0.0), (1.15, 0, 0), (0, 0.9, 0), with_uvs=True), material)
    builder.add_light("sun", "directional", 3.0, target=(0.2, -0.3, -1.0))
    return builder


def wavy_normal(x: int, y: int) -> tuple:
    """A tilt that differs along both axes, so that a swapped or reversed axis shows."""
    tilt_x, tilt_y = 0.45 * math.sin(1.3 * x + 0.4) + 0.1, 0.35 * math.cos(0.9 * y) + 0.2
    length = math.sqrt(tilt_x * tilt_x + tilt_y * tilt_y + 1.0)
    return tuple(round(127.5 * (c / length + 1.0)) for c in (tilt_x, tilt_y, 1.0))


def normal_map() -> GltfBuilder:
    """Three panels under one light: coated, metal with a stronger map, and coated in a mirrored copy."""
    builder = GltfBuilder()
    stage(builder, (0.0, 2.4, 1.6), (0.0, 0.0, 0.0), 38.0)
    texture = builder.add_texture("waves", picture(8, 8, wavy_normal), REPEAT, REPEAT)
    coated = builder.add_material("coated", (0.5, 0.4, 0.3), roughness=0.5,
                                  normal_texture=builder.texture_slot(texture))
    metal = builder.add_material("metal", (0.6, 0.7, 0.9), metallic=1.0, roughness=0.6,
                                 normal_texture=builder.texture_slot(texture, normal_scale=1.3))
    panel = quad((-0.35, 0.0, 0.8), (0.7, 0.0, 0.0), (0.0, 0.0, -1.6), with_uvs=True)
    mesh = builder.add_mesh("coated", panel, coated)
    builder.add_node("coated", mesh=mesh, translation=(-0.75, 0.0, 0.0))
    builder.add_node("mirrored", mesh=mesh, translation=(0.75, 0.0, 0.0), scale=(-1.0, 1.0, 1.0))
    place(builder, "metal", panel, metal, rotation=turn("y", 180))
    builder.add_light("sun", "directional", 3.0, (1.0, 0.9, 0.8), position=(0, 3, 0), target=(0.9, 1.6, -0.7))
    return builder


def instances() -> GltfBuilder:
    """One mesh in nested, stretched and mirrored places; a mirrored lamp that must still shine downwards."""
    builder = GltfBuilder()
    stage(builder)
    place(builder, "floor", floor(1.5), grey(builder))
    wedge = quad((-0.3, 0.0, 0.3), (0.6, 0.0, 0.0), (0.1, 0.7, -0.3))
    colour = builder.add_material("wedge", (0.7, 0.3, 0.2), specular=0.0)
    mesh = builder.add_mesh("wedge", wedge, colour)
    ball = builder.add_mesh("ball", sphere(0.25, 24, 12), builder.add_material("ball", (0.3, 0.5, 0.7), roughness=0.7))
    group = builder.add_node("group", translation=(0.5, 0.0, -0.3), rotation=turn("y", -40), scale=(1.2, 1.0, 0.8))
    for parent, place_x in [(None, -0.7), (group, 0.1)]:
        builder.add_node("wedge", parent, translation=(place_x, 0.001, 0.2), mesh=mesh)
        builder.add_node("ball", parent, translation=(place_x, 0.3, 0.6), scale=(-1.0, 0.7, 1.0), mesh=ball,
                         rotation=turn("z", 30))
    builder.add_node("mirrored wedge", matrix=[-0.8, 0.2, 0, 0, 0, 0.9, 0.1, 0, 0.3, 0, 1, 0, 0.1, 0.001, -0.5, 1],
                     mesh=mesh)
    lamp = builder.add_material("lamp", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 0.9, 0.8), emission_strength=8.0)
    place(builder, "lamp", quad((-0.4, 0, -0.4), (0.8, 0, 0), (0, 0, 0.8)), lamp, translation=(0.3, 1.8, 0.0),
          scale=(-1.0, 1.0, 1.0))
    return builder


def smooth_normals() -> GltfBuilder:
    """Coarse balls with smooth normals: shading and geometric horizon lie far apart."""
    builder = GltfBuilder()
    stage(builder, (0.0, 1.0, 2.9), (0.0, 0.45, 0.0), 38.0)
    place(builder, "floor", floor(1.5), grey(builder))
    lambert = builder.add_material("lambert", (0.7, 0.6, 0.5), specular=0.0)
    coated = builder.add_material("coated", (0.2, 0.4, 0.3), roughness=0.55)
    metal = builder.add_material("metal", (0.8, 0.8, 0.9), metallic=1.0, roughness=0.6)
    for name, material, x in [("lambert", lambert, -0.75), ("coated", coated, 0.0), ("metal", metal, 0.75)]:
        place(builder, name, sphere(0.35, 10, 6), material, translation=(x, 0.45, 0.0))
    builder.add_light("lamp", "point", 5.0, (1.0, 0.9, 0.8), position=(1.6, 1.4, 0.4))
    return builder


def orthographic_environment() -> GltfBuilder:
    builder = GltfBuilder()
    builder.add_orthographic_camera("camera", (1.5, 2.0, 2.5), (0.0, 0.3, 0.0), 1.2, 0.9)
    place(builder, "floor", floor(1.0), builder.add_material("floor", (0.5, 0.45, 0.4), specular=0.0))
    green = builder.add_material("green", (0.2, 0.6, 0.3), specular=0.0)
    place(builder, "block", box((0.5, 0.8, 0.5)), green, translation=(-0.2, 0.001, 0.1), rotation=turn("y", 15))
    return builder


def environment_seen() -> GltfBuilder:
    """The environment itself, and its picture in a mirror: which way round it is."""
    builder = GltfBuilder()
    stage(builder, (0.3, 0.4, 1.5), (0.0, 0.3, 0.0), 75.0)
    mirror = builder.add_material("mirror", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)
    place(builder, "mirror", quad((-0.5, -0.3, -0.3), (0.9, 0.0, 0.3), (0.0, 0.8, -0.4)), mirror)
    return builder


SCENES = [
    ComparisonScene("lambert_point", "Lambert, point light, interreflection", lambert_point, 5, 256, 64),
    ComparisonScene("coat_rough_directional", "rough coat, ior, specular colour, directional light",
                    coat_rough_directional, 3, 256, 16),
    ComparisonScene("coat_smooth_sphere_light", "glossy coat, sphere light seen and reflected",
                    coat_smooth_sphere_light, 3, 256, 24),
    ComparisonScene("metal_rough_spot", "rough coloured metal, spot light", metal_rough_spot, 4, 256, 24),
    ComparisonScene("metal_glossy_lamps", "glossy metal, textured and double-sided emitters",
                    metal_glossy_lamps, 4, 256, 24),
    ComparisonScene("mixed_metallic_environment", "metallic 0.5, metallic-roughness texture, environment",
                    mixed_metallic_environment, 3, 256, 24, environment=True),
    ComparisonScene("mirrors", "perfect mirrors: white, tinted, dielectric; emitter and point light",
                    mirrors, 6, 256, 24),
    ComparisonScene("textures", "wrap modes, filters, texture transforms", textures, 1, 256, 64),
    ComparisonScene("normal_map", "normal maps: coat, metal, scale, mirrored copy", normal_map, 2, 256, 16),
    ComparisonScene("instances", "nested, stretched and mirrored copies, mirrored emitter", instances, 4, 256, 24),
    ComparisonScene("smooth_normals", "coarse smooth balls: Lambert, coat, metal", smooth_normals, 4, 256, 16),
    ComparisonScene("orthographic_environment", "parallel camera, environment light on Lambert",
                    orthographic_environment, 4, 256, 64, environment=True),
    ComparisonScene("environment_seen", "orientation of the environment, direct and mirrored",
                    environment_seen, 3, 256, 64, environment=True),
    ComparisonScene("cornell", "scenes/cornell.glb: emitter, rough metal and coated blocks", cornell.build, 6, 256, 24),
]


# ---- files

def environment_radiance(u: float, v: float) -> tuple:
    """A sky with a broad sun, different in every direction; u, v in [0, 1], v downwards."""
    theta, phi = math.pi * v, 2.0 * math.pi * (u - 0.5)
    direction = (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
    sun = (0.5, 0.7, 0.51)
    toward_sun = sum(direction[c] * sun[c] for c in range(3))
    glow = 12.0 * math.exp(25.0 * (toward_sun - 1.0))
    return (0.25 + 0.2 * direction[0] + glow, 0.3 + 0.2 * direction[1] + 0.8 * glow,
            0.35 + 0.25 * direction[2] + 0.5 * glow)


def write_environment(path: str, width: int = 256, height: int = 128) -> None:
    """Writes the environment as a 32-bit EXR."""
    import mitsuba as mi
    import numpy
    values = [[environment_radiance((x + 0.5) / width, (y + 0.5) / height) for x in range(width)]
              for y in range(height)]
    mi.Bitmap(numpy.array(values, dtype=numpy.float32)).write(path)


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    os.makedirs(sys.argv[1], exist_ok=True)
    write_environment(os.path.join(sys.argv[1], ENVIRONMENT))
    for scene in SCENES:
        scene.build().write(os.path.join(sys.argv[1], scene.name + ".glb"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
