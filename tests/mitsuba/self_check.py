#!/usr/bin/env python3
"""Checks the translation to Mitsuba against formulas, without our renderer: so that a difference that compare.py finds
is our renderer's and not the translation's.

Usage: self_check.py FOLDER (for temporary files). Exit code 1 and a line per failure otherwise.
"""

from __future__ import annotations

import math
import os
import sys

import mitsuba as mi
import numpy

import convert
import scenes
from gltf_writer import CLAMP_TO_EDGE, NEAREST, GltfBuilder
from shapes import box, floor, quad

failures: list[str] = []
folder = ""
ALBEDO = 0.6


def check(name: str, got, expected, tolerance: float) -> None:
    got, expected = numpy.asarray(got, dtype=float), numpy.asarray(expected, dtype=float)
    error = float(numpy.max(numpy.abs(got - expected) / numpy.maximum(numpy.abs(expected), 1e-3)))
    print(f"{'ok  ' if error <= tolerance else 'FAIL'} {name}: relative error {error:.2e} (at most {tolerance:.0e})")
    if not error <= tolerance:
        failures.append(f"{name}: got {got.ravel()[:6]}, expected {expected.ravel()[:6]}")


def render(builder: GltfBuilder, width: int, height: int, max_depth: int = 1, spp: int = 64, environment=None):
    path = os.path.join(folder, "self_check.glb")
    builder.write(path)
    scene = convert.load_scene(path, width, height, "exact", environment)
    return numpy.array(mi.render(scene, integrator=convert.path_integrator(max_depth), spp=spp))


def floor_from_above(material_of=None) -> GltfBuilder:
    """A floor seen straight from above by a parallel camera of 2 m x 2 m; the picture's right is +X, its top -Z."""
    builder = GltfBuilder()
    builder.add_orthographic_camera("camera", (0.0, 3.0, 0.0), (0.0, 0.0, 0.0), 1.0, 1.0, up=(0.0, 0.0, -1.0))
    material = material_of(builder) if material_of else scenes.grey(builder, ALBEDO)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(2.0, with_uvs=True), material))
    return builder


def pixel_centres(size: int):
    """x and z on that floor of each pixel's centre."""
    axis = (numpy.arange(size) + 0.5) / size * 2.0 - 1.0
    return numpy.meshgrid(axis, axis)


def check_point_light() -> None:
    builder = floor_from_above()
    position = numpy.array([0.4, 0.9, -0.3])
    builder.add_light("lamp", "point", 5.0, (1.0, 0.5, 0.25), position=tuple(position))
    x, z = pixel_centres(32)
    distance = numpy.sqrt((x - position[0]) ** 2 + position[1] ** 2 + (z - position[2]) ** 2)
    expected = ALBEDO / math.pi * 5.0 * position[1] / distance**3
    check("point light on a Lambert floor", render(builder, 32, 32)[..., 0], expected, 0.02)
    check("its colour", render(builder, 32, 32)[..., 2], 0.25 * expected, 0.02)


def check_directional_light() -> None:
    builder = floor_from_above()
    builder.add_light("sun", "directional", 3.0, position=(0, 4, 0), target=(3, 0, 0))
    check("directional light", render(builder, 4, 4)[..., 0], ALBEDO / math.pi * 3.0 * 0.8, 1e-4)


def check_spot_light() -> None:
    builder = floor_from_above()
    inner, outer = 0.2, 0.5
    builder.add_light("spot", "spot", 5.0, position=(0.1, 1.5, 0.2), target=(0.3, 0.0, 0.1), inner_angle=inner,
                      outer_angle=outer)
    x, z = pixel_centres(64)
    offset = numpy.stack([x - 0.1, numpy.full_like(x, -1.5), z - 0.2], -1)
    distance = numpy.linalg.norm(offset, axis=-1)
    axis = numpy.array([0.2, -1.5, -0.1]) / math.sqrt(0.04 + 2.25 + 0.01)
    ramp = (offset @ axis / distance - math.cos(outer)) / (math.cos(inner) - math.cos(outer))
    expected = ALBEDO / math.pi * 5.0 * 1.5 / distance**3 * numpy.clip(ramp, 0, 1) ** 2
    got = render(builder, 64, 64)[..., 0]
    check("spot light, whole cone", got.mean(), expected.mean(), 0.003)
    check("spot light, blocks", blocks(got), blocks(expected) + 1e-9, 0.03)


def blocks(image: numpy.ndarray) -> numpy.ndarray:
    return image.reshape(8, 8, 8, 8).mean((1, 3))[2:6, 2:6]


def check_sphere_light() -> None:
    builder = floor_from_above()
    builder.add_light("bulb", "point", 5.0, position=(0.0, 4.0, 0.0), radius=0.5)
    x, z = pixel_centres(8)
    expected = ALBEDO / math.pi * 5.0 * 4.0 / (x**2 + 16.0 + z**2) ** 1.5
    # A sphere wholly above the horizon lights the floor as its centre would.
    check("sphere light", render(builder, 8, 8, spp=256)[..., 0], expected, 0.01)


def check_texture_orientation() -> None:
    """2x2 texels on the floor: the picture lies with its top to -Z, as it is seen from above."""
    colours = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)]
    png = scenes.picture(2, 2, lambda x, y: colours[x + 2 * y])

    def material(builder: GltfBuilder) -> int:
        texture = builder.add_texture("t", png, CLAMP_TO_EDGE, CLAMP_TO_EDGE, NEAREST)
        # The floor's uv (0, 0) is at -X, +Z; a picture's first row belongs to v = 0: hence the turned-over picture.
        slot = builder.texture_slot(texture)
        return builder.add_material("m", (0, 0, 0), specular=0.0, emission=(1, 1, 1), emissive_texture=slot)

    got = render(floor_from_above(material), 2, 2, spp=4)
    expected = numpy.array([[colours[2], colours[3]], [colours[0], colours[1]]]) / 255.0
    check("texture orientation", got, expected, 1e-3)


def check_texture_transform() -> None:
    """A quarter turn and an offset, against the formula of KHR_texture_transform."""
    png = scenes.picture(4, 4, scenes.patchwork)

    def material(builder: GltfBuilder) -> int:
        texture = builder.add_texture("t", png, filter_mode=NEAREST)
        slot = builder.texture_slot(texture, offset=(0.25, 0.5), rotation=math.pi / 2.0, scale=(0.5, 2.0))
        return builder.add_material("m", (0, 0, 0), specular=0.0, emission=(1, 1, 1), emissive_texture=slot)

    # One pixel of 16 x 16 on a quarter of the uv range: u, v from 0.25 to 0.75.
    got = render(floor_from_above(material), 16, 16, spp=1)
    u, v = numpy.meshgrid((numpy.arange(16) + 0.5) / 32 + 0.25, 0.75 - (numpy.arange(16) + 0.5) / 32)
    scaled_u, scaled_v = 0.5 * u, 2.0 * v
    turned_u, turned_v = scaled_v + 0.25, -scaled_u + 0.5
    expected = numpy.zeros((16, 16, 3))
    for row in range(16):
        for column in range(16):
            texel = scenes.patchwork(int(math.floor(turned_u[row, column] * 4)) % 4,
                                     int(math.floor(turned_v[row, column] * 4)) % 4)
            encoded = numpy.array(texel) / 255.0
            expected[row, column] = numpy.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    check("texture transform", got, expected, 1e-3)


def check_environment() -> None:
    """Cameras in six and more directions must see environment_radiance there."""
    environment = os.path.join(folder, scenes.ENVIRONMENT)
    scenes.write_environment(environment)
    for direction in [(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0), (0.1, 1, 0), (0, -1, 0.1), (0.5, 0.7, 0.51)]:
        builder = GltfBuilder()
        builder.add_perspective_camera("camera", (0, 0, 0), direction, 0.002, 1.0, up=(0.0, 1.0, 0.01))
        material = scenes.grey(builder)
        far_below = builder.add_mesh("speck", quad((90, -90, 90), (0.1, 0, 0), (0, 0.1, 0)), material)
        builder.add_node("speck", mesh=far_below)
        got = render(builder, 1, 1, spp=4, environment=environment)[0, 0]
        x, y, z = numpy.array(direction) / numpy.linalg.norm(direction)
        u, v = 0.5 + math.atan2(x, -z) / (2 * math.pi), math.acos(y) / math.pi
        check(f"environment towards {direction}", got, scenes.environment_radiance(u, v), 0.005)


def check_furnace() -> None:
    """Nothing but light of radiance 1 everywhere: a white Lambert floor is as bright, a coat as its albedo says."""
    environment = os.path.join(folder, "white.exr")
    mi.Bitmap(numpy.ones((16, 32, 3), dtype=numpy.float32)).write(environment)
    white = floor_from_above(lambda builder: builder.add_material("white", (1, 1, 1), specular=0.0))
    check("furnace, white Lambert", render(white, 8, 8, spp=1024, environment=environment).mean(), 1.0, 5e-3)
    mirror = floor_from_above(lambda builder: builder.add_material("m", (1, 1, 1), metallic=1.0, roughness=0.0))
    check("furnace, mirror", render(mirror, 8, 8, environment=environment), 1.0, 1e-3)
    tinted = floor_from_above(lambda builder: builder.add_material("m", (0.5, 0.5, 0.5), metallic=1.0, roughness=0.0))
    check("furnace, tinted mirror", render(tinted, 8, 8, environment=environment), 0.5, 1e-3)
    coated = floor_from_above(lambda builder: builder.add_material("m", (0.5, 0.5, 0.5), roughness=0.0))
    # Base: 2 integral of (1 - F(v.h)) base cos sin, where v.h = cos(theta / 2); coat: F0.
    theta = (numpy.arange(20000) + 0.5) / 20000 * math.pi / 2
    fresnel = 0.04 + 0.96 * (1 - numpy.cos(theta / 2)) ** 5
    base = numpy.sum(2 * (1 - fresnel) * 0.5 * numpy.cos(theta) * numpy.sin(theta)) * (math.pi / 2 / 20000)
    check("furnace, polished coat", render(coated, 16, 16, spp=256, environment=environment).mean(), base + 0.04, 0.003)


def check_projection() -> None:
    """A bright speck lands in the pixel where a pinhole camera must put it."""
    builder = GltfBuilder()
    builder.add_perspective_camera("camera", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 2.0 * math.atan(0.5), 2.0)
    glow = builder.add_material("glow", (0, 0, 0), specular=0.0, emission=(1, 1, 1))
    # At depth 2 the picture is 4 m wide and 2 m high: 16 x 8 pixels of 0.25 m. Column 12, row 1 from the top.
    builder.add_node("speck", mesh=builder.add_mesh("speck", quad((1.0, 0.5, -2), (0.25, 0, 0), (0, 0.25, 0)), glow))
    got = render(builder, 16, 8, spp=64)[..., 0]
    expected = numpy.zeros((8, 16))
    expected[1, 12] = 1.0
    check("projection", got, expected, 1e-2)


def check_normal_map() -> None:
    """A constant tilt towards +X of the picture and towards its top, under a light from straight above."""
    tilt = numpy.array([0.3, 0.4, math.sqrt(1 - 0.25)])
    texel = tuple(int(round(127.5 * (c + 1))) for c in tilt)
    tilt = 2.0 * numpy.array(texel) / 255.0 - 1.0
    tilt = tilt / numpy.linalg.norm(tilt)

    def material(builder: GltfBuilder) -> int:
        texture = builder.add_texture("t", scenes.picture(2, 2, lambda x, y: texel))
        return builder.add_material("m", (ALBEDO,) * 3, specular=0.0, normal_texture=builder.texture_slot(texture))

    # The floor's u runs along +X and its v along -Z; the top of a picture is where v is small: +Z.
    normal = numpy.array([tilt[0], tilt[2], tilt[1]])
    for direction in [(1.0, 1.0, 0.5), (-0.5, 1.0, 1.0), (-0.6, 1.0, -0.4)]:
        builder = floor_from_above(material)
        to_light = numpy.array(direction) / numpy.linalg.norm(direction)
        builder.add_light("sun", "directional", 1.0, position=direction, target=(0, 0, 0))
        expected = ALBEDO / math.pi * max(0.0, float(normal @ to_light))
        check(f"normal map, light from {direction}", render(builder, 2, 2)[..., 0], expected, 1e-3)


def check_mirrored_emitter() -> None:
    """A mirroring transform keeps the lit side of a one-sided emitter."""
    for scale in [(1, 1, 1), (-1, 1, 1)]:
        builder = floor_from_above()
        glow = builder.add_material("glow", (0, 0, 0), specular=0.0, emission=(1, 1, 1), emission_strength=2.0)
        lamp = builder.add_mesh("lamp", quad((-50, 0, -50), (100, 0, 0), (0, 0, 100)), glow)
        builder.add_node("lamp", mesh=lamp, translation=(0, 5.0, 0), scale=scale)
        # A ceiling so wide that it is nearly the whole sky; the rest is the formula for a square over its centre.
        a = 50.0 / 5.0
        square = 4.0 / (2 * math.pi) * 2 * (a / math.sqrt(1 + a * a)) * math.atan(a / math.sqrt(1 + a * a))
        got = render(builder, 8, 8, spp=512).mean()
        check(f"emitter scaled by {scale}", got, ALBEDO * 2.0 * square, 0.02)


def main() -> int:
    global folder
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    folder = sys.argv[1]
    os.makedirs(folder, exist_ok=True)
    convert.set_up("scalar_rgb")
    for test in [check_point_light, check_directional_light, check_spot_light, check_sphere_light,
                 check_texture_orientation, check_texture_transform, check_environment, check_furnace,
                 check_projection, check_normal_map, check_mirrored_emitter]:
        test()
    for failure in failures:
        print(f"error: {failure}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
