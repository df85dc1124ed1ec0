#!/usr/bin/env python3
"""glTF scenes as Mitsuba 3 scenes.

Two ways to translate materials:
 - exact: our material model to the letter, by a Python BSDF (scalar variants only), and Mitsuba's own BSDFs where they
   are exactly equal. For comparing pictures.
 - builtin: Mitsuba's nearest own BSDFs. For comparing speed, and for variants that cannot run Python per ray.

Run as a program it renders one scene to a PNG for a look: convert.py SCENE.glb OUT.png [--size 320x240] [--spp 16]
[--max-depth 12] [--env FILE] [--materials exact|builtin].
"""

from __future__ import annotations

import argparse
import math
import sys

import mitsuba as mi
import numpy

from glb import Glb, PlacedNode

HALF_TURN_ABOUT_Y = numpy.diag([-1.0, 1.0, -1.0, 1.0])
# A double-sided emitter becomes two sheets this far apart (metres): Mitsuba's area lights emit from one side only.
SHEET_OFFSET = 5e-5
WRAP_NAMES = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
DELTA_ALPHA = 1e-4


class Converter:
    """Builds the scene dictionary for one file; mi.set_variant must have been called."""

    def __init__(self, path: str, width: int, height: int, materials: str = "exact", environment: str | None = None,
                 environment_scale: float = 1.0) -> None:
        self.glb = Glb(path)
        self.width, self.height = width, height
        self.exact = materials == "exact"
        self.scene: dict = {"type": "scene"}
        self.nodes = self.glb.placed_nodes()
        for number, placed in enumerate(self.nodes):
            if "mesh" in placed.node:
                self.add_mesh(number, placed)
            light = self.glb.extension(placed.node, "KHR_lights_punctual").get("light")
            if light is not None:
                self.add_light(number, placed, light)
        self.add_sensor()
        if environment:
            self.scene["environment"] = environment_emitter(environment, environment_scale)

    # ---- camera

    def add_sensor(self) -> None:
        placed = next((p for p in self.nodes if "camera" in p.node), None)
        if placed is None:
            raise ValueError("the scene has no camera")
        camera = self.glb.document["cameras"][placed.node["camera"]]
        # glTF cameras look along -Z with +X to the right, Mitsuba's along +Z with +X to the left.
        to_world = without_scale(placed.to_world) @ HALF_TURN_ABOUT_Y
        sensor: dict = {"near_clip": 1e-3, "far_clip": 1e4}
        if camera["type"] == "perspective":
            sensor.update(type="perspective", fov_axis="y", fov=math.degrees(camera["perspective"]["yfov"]))
        else:
            # Mitsuba's parallel projection is two units wide, and as high as the picture's aspect makes it.
            half_width, half_height = camera["orthographic"]["xmag"], camera["orthographic"]["ymag"]
            to_world = to_world @ numpy.diag([half_width, half_height * self.width / self.height, 1.0, 1.0])
            sensor.update(type="orthographic")
        sensor["to_world"] = mi.ScalarTransform4f(to_world)
        sensor["film"] = {"type": "hdrfilm", "width": self.width, "height": self.height, "pixel_format": "rgb",
                          "component_format": "float32", "rfilter": {"type": "box"}}
        sensor["sampler"] = {"type": "independent"}
        self.scene["sensor"] = sensor

    # ---- lights

    def add_light(self, number: int, placed: PlacedNode, index: int) -> None:
        light = self.glb.document["extensions"]["KHR_lights_punctual"]["lights"][index]
        intensity = [light.get("intensity", 1.0) * c for c in light.get("color", [1, 1, 1])]
        position = placed.to_world[:3, 3]
        direction = unit(placed.to_world[:3, :3] @ numpy.array([0.0, 0.0, -1.0]))
        radius = light.get("extras", {}).get("radius", placed.node.get("extras", {}).get("radius", 0.0))
        name = f"light{number}"
        if light["type"] == "directional":
            self.scene[name] = {"type": "directional", "direction": list(direction), "irradiance": rgb(intensity)}
        elif light["type"] == "spot":
            self.scene[name] = self.spot(light, position, direction, intensity)
        elif radius > 0.0:
            radiance = [c / (math.pi * radius * radius) for c in intensity]
            self.scene[name] = {"type": "sphere", "center": list(position), "radius": radius,
                                "emitter": {"type": "area", "radiance": rgb(radiance)},
                                "bsdf": {"type": "diffuse", "reflectance": rgb([0, 0, 0])}}
        else:
            self.scene[name] = {"type": "point", "position": list(position), "intensity": rgb(intensity)}

    def spot(self, light: dict, position, direction, intensity) -> dict:
        cone = light.get("spot", {})
        inner, outer = cone.get("innerConeAngle", 0.0), cone.get("outerConeAngle", math.pi / 4.0)
        if self.exact:
            return {"type": "gltf_spot", "position": list(position), "direction": list(direction),
                    "red": intensity[0], "green": intensity[1], "blue": intensity[2], "inner": inner, "outer": outer}
        origin, target = mi.ScalarPoint3f(list(position)), mi.ScalarPoint3f(list(position + direction))
        up = [1, 0, 0] if abs(direction[0]) < 0.8 else [0, 1, 0]
        return {"type": "spot", "intensity": rgb(intensity), "cutoff_angle": math.degrees(outer),
                "beam_width": math.degrees(inner),
                "to_world": mi.ScalarTransform4f().look_at(origin=origin, target=target, up=up)}

    # ---- meshes

    def add_mesh(self, number: int, placed: PlacedNode) -> None:
        for part, primitive in enumerate(self.glb.document["meshes"][placed.node["mesh"]]["primitives"]):
            material = self.glb.document["materials"][primitive["material"]]
            name = f"mesh{number}_{part}"
            emission = emission_factor(material)
            if any(emission) and material.get("doubleSided"):
                self.scene[name + "_front"] = self.mesh(name, placed, primitive, material, SHEET_OFFSET, False)
                self.scene[name + "_back"] = self.mesh(name, placed, primitive, material, SHEET_OFFSET, True)
            else:
                self.scene[name] = self.mesh(name, placed, primitive, material, 0.0, False)

    def mesh(self, name: str, placed: PlacedNode, primitive: dict, material: dict, offset: float, turned: bool):
        """A Mitsuba mesh in world space; `turned` reverses its sides, `offset` (metres) moves it along its normals."""
        attributes = primitive["attributes"]
        positions = self.glb.accessor(attributes["POSITION"]) @ placed.to_world[:3, :3].T + placed.to_world[:3, 3]
        faces = self.glb.accessor(primitive["indices"]).reshape(-1, 3).astype(numpy.uint32)
        # A transform that mirrors turns the triangles' order around; glTF keeps the outside outside.
        if (numpy.linalg.det(placed.to_world[:3, :3]) < 0.0) != turned:
            faces = faces[:, [0, 2, 1]]
        if "NORMAL" in attributes:
            normals = self.glb.accessor(attributes["NORMAL"]) @ numpy.linalg.inv(placed.to_world[:3, :3])
            normals = normals / numpy.linalg.norm(normals, axis=1, keepdims=True)
            normals = -normals if turned else normals
            if offset:
                positions = positions + offset * normals
        else:
            positions, faces, normals = positions[faces.ravel()], numpy.arange(faces.size).reshape(-1, 3), None
        uvs = self.glb.accessor(attributes["TEXCOORD_0"]) if "TEXCOORD_0" in attributes else None
        if uvs is not None and normals is None:
            uvs = uvs[self.glb.accessor(primitive["indices"]).ravel()]
        properties = mi.Properties()
        flat = normals is None or is_flat(positions, faces, normals)
        properties["bsdf"] = mi.load_dict(self.bsdf(material, flat))
        if any(emission_factor(material)):
            properties["emitter"] = mi.load_dict(self.area_emitter(material))
        mesh = mi.Mesh(name, len(positions), len(faces), has_vertex_normals=normals is not None,
                       has_vertex_texcoords=uvs is not None, props=properties)
        buffers = {"vertex_positions": positions, "faces": faces, "vertex_normals": normals, "vertex_texcoords": uvs}
        fill(mesh, {key: values for key, values in buffers.items() if values is not None})
        return mesh

    # ---- materials

    def area_emitter(self, material: dict) -> dict:
        factor = emission_factor(material)
        slot = material.get("emissiveTexture")
        radiance = self.texture(slot, srgb=True, factor=factor) if slot else rgb(factor)
        return {"type": "area", "radiance": radiance}

    def bsdf(self, material: dict, flat: bool) -> dict:
        pbr = material.get("pbrMetallicRoughness", {})
        roughness, metallic = pbr.get("roughnessFactor", 1.0), pbr.get("metallicFactor", 1.0)
        base = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        specular = self.glb.extension(material, "KHR_materials_specular").get("specularFactor", 1.0)
        plain = "metallicRoughnessTexture" not in pbr and "normalTexture" not in material
        if not self.exact:
            return self.nearest_builtin(pbr, base, metallic, roughness, specular)
        # Where shading and geometric normal differ, Mitsuba's own BSDFs do not test the geometric horizon.
        if plain and flat and metallic == 0.0 and specular == 0.0:
            return two_sided(self.lambert(pbr, base))
        if plain and flat and metallic == 1.0 and roughness * roughness < DELTA_ALPHA and min(base) == 1.0:
            return two_sided({"type": "conductor", "material": "none"})
        return self.python_bsdf(material, pbr, base, metallic, roughness, specular)

    def lambert(self, pbr: dict, base) -> dict:
        slot = pbr.get("baseColorTexture")
        return {"type": "diffuse", "reflectance": self.texture(slot, srgb=True, factor=base) if slot else rgb(base)}

    def nearest_builtin(self, pbr: dict, base, metallic: float, roughness: float, specular: float) -> dict:
        """Mitsuba's BSDF of nearest look and cost: rough conductor, rough plastic or diffuse."""
        alpha = roughness * roughness
        if metallic > 0.5:
            if alpha < DELTA_ALPHA:
                return two_sided({"type": "conductor", "material": "none", "specular_reflectance": rgb(base)})
            return two_sided({"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha,
                              "specular_reflectance": rgb(base)})
        if specular == 0.0:
            return two_sided(self.lambert(pbr, base))
        return two_sided({"type": "roughplastic", "distribution": "ggx", "alpha": max(alpha, DELTA_ALPHA),
                          "diffuse_reflectance": self.lambert(pbr, base)["reflectance"]})

    def python_bsdf(self, material: dict, pbr: dict, base, metallic: float, roughness: float, specular: float) -> dict:
        from gltf_bsdf import MATERIALS, GltfMaterial
        specular_color = self.glb.extension(material, "KHR_materials_specular").get("specularColorFactor", [1, 1, 1])
        entry = GltfMaterial(base_color=tuple(base), metallic=metallic, roughness=roughness, specular=specular,
                             ior=self.glb.extension(material, "KHR_materials_ior").get("ior", 1.5),
                             specular_color=tuple(specular_color))
        for key, holder, name, srgb in [("base_color_texture", pbr, "baseColorTexture", True),
                                        ("metallic_roughness_texture", pbr, "metallicRoughnessTexture", False),
                                        ("normal_texture", material, "normalTexture", False)]:
            if name in holder:
                setattr(entry, key, mi.load_dict(self.texture(holder[name], srgb)))
        entry.normal_scale = material.get("normalTexture", {}).get("scale", 1.0)
        MATERIALS.append(entry)
        return {"type": "gltf", "material": len(MATERIALS) - 1}

    # ---- textures

    def texture(self, slot: dict, srgb: bool, factor=(1.0, 1.0, 1.0)) -> dict:
        """A Mitsuba bitmap of linear values times `factor`; in both formats v = 0 is the picture's first row."""
        texture = self.glb.document["textures"][slot["index"]]
        sampler = self.glb.document["samplers"][texture["sampler"]] if "sampler" in texture else {}
        values = self.picture(texture["source"], srgb) * numpy.array(factor)
        wrap_u, wrap_v = (WRAP_NAMES[sampler.get(key, 10497)] for key in ["wrapS", "wrapT"])
        to_uv = uv_matrix(self.glb.extension(slot, "KHR_texture_transform"))
        values, wrap, to_uv = one_wrap_mode(values, wrap_u, wrap_v, to_uv)
        return {"type": "bitmap", "bitmap": mi.Bitmap(values.astype(numpy.float32)), "raw": True, "wrap_mode": wrap,
                "filter_type": "nearest" if sampler.get("magFilter") == 9728 else "bilinear",
                "format": "variant", "to_uv": mi.ScalarTransform3f(to_uv)}

    def picture(self, image: int, srgb: bool) -> numpy.ndarray:
        data = self.glb.buffer_view(self.glb.document["images"][image]["bufferView"])
        stream = mi.MemoryStream()
        stream.write(data)
        stream.seek(0)
        values = numpy.array(mi.Bitmap(stream), dtype=float) / 255.0
        values = values[..., :3]
        if srgb:
            values = numpy.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
        return values


def fill(mesh, buffers: dict) -> None:
    """Sets a mesh's buffers, all before the one update: in between, Mitsuba would see a mesh without area."""
    parameters = mi.traverse(mesh)
    for key, values in buffers.items():
        parameters[key] = type(parameters[key])(values.ravel())
    parameters.update()


def two_sided(bsdf: dict) -> dict:
    return {"type": "twosided", "bsdf": bsdf}


def rgb(value) -> dict:
    return {"type": "rgb", "value": [float(c) for c in value]}


def unit(vector: numpy.ndarray) -> numpy.ndarray:
    return vector / numpy.linalg.norm(vector)


def without_scale(matrix: numpy.ndarray) -> numpy.ndarray:
    """A rigid camera transform: glTF says that a camera node's scale does not count."""
    result = matrix.copy()
    result[:3, :3] = matrix[:3, :3] / numpy.linalg.norm(matrix[:3, :3], axis=0)
    return result


def emission_factor(material: dict) -> list[float]:
    """Radiance factor, W/(m^2 sr), per channel."""
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    return [strength * c for c in material.get("emissiveFactor", [0, 0, 0])]


def is_flat(positions, faces, normals) -> bool:
    """Whether the vertex normals are the triangles' own."""
    corners = positions[faces]
    true = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    true = true / numpy.linalg.norm(true, axis=1, keepdims=True)
    return bool(numpy.min(numpy.einsum("fc,fkc->fk", true, normals[faces])) > 1.0 - 1e-6)


def uv_matrix(transform: dict) -> numpy.ndarray:
    """KHR_texture_transform as a 3x3 matrix: translation * rotation * scale.

    The extension's rotation is counter-clockwise for the picture, whose v runs downwards:
    u' = cos u + sin v, v' = -sin u + cos v.
    """
    angle = transform.get("rotation", 0.0)
    rotation = numpy.array([[math.cos(angle), math.sin(angle), 0], [-math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
    translation = numpy.eye(3)
    translation[:2, 2] = transform.get("offset", [0, 0])
    return translation @ rotation @ numpy.diag([*transform.get("scale", [1, 1]), 1.0])


def one_wrap_mode(values: numpy.ndarray, wrap_u: str, wrap_v: str, to_uv: numpy.ndarray):
    """Mitsuba wraps both axes alike. A mirrored picture that repeats is a repeating picture of twice the size."""
    if wrap_u == wrap_v:
        return values, wrap_u, to_uv
    if "clamp" in (wrap_u, wrap_v):
        raise ValueError("clamping along one axis only cannot be expressed in Mitsuba")
    axis = 1 if wrap_u == "mirror" else 0
    doubled = numpy.concatenate([values, numpy.flip(values, axis)], axis)
    scale = numpy.diag([0.5, 1.0, 1.0] if axis == 1 else [1.0, 0.5, 1.0])
    return doubled, "repeat", scale @ to_uv


# ---- environment

def environment_emitter(path: str, scale: float) -> dict:
    """Our lat-long picture as Mitsuba's.

    Ours: u = 0.5 + atan2(d.x, -d.z) / (2 pi), v = acos(d.y) / pi, row 0 up: the centre column looks along -Z.
    Mitsuba's u lacks the 0.5: half a turn about Y. Its texel centres also lie elsewhere, at u = column / width and
    v = row / (height - 1) instead of (column + 0.5) / width and (row + 0.5) / height; so we read ours at its places.
    """
    ours = numpy.array(mi.Bitmap(path).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), dtype=float)
    resampled = scale * resample_environment(ours, max(1024, ours.shape[1]), max(513, ours.shape[0] + 1))
    return {"type": "envmap", "bitmap": mi.Bitmap(resampled.astype(numpy.float32)), "scale": 1.0,
            "to_world": mi.ScalarTransform4f(HALF_TURN_ABOUT_Y)}


def resample_environment(ours: numpy.ndarray, width: int, height: int) -> numpy.ndarray:
    """Bilinear values at u = column / width, v = row / (height - 1); wraps in u, clamps in v."""
    rows, columns = ours.shape[:2]
    x = numpy.arange(width) / width * columns - 0.5
    y = numpy.arange(height) / (height - 1) * rows - 0.5
    x0, y0 = numpy.floor(x).astype(int), numpy.floor(y).astype(int)
    fx, fy = (x - x0)[None, :, None], (y - y0)[:, None, None]

    def texels(iy, ix):
        return ours[numpy.clip(iy, 0, rows - 1)][:, ix % columns]

    upper = texels(y0, x0) * (1 - fx) + texels(y0, x0 + 1) * fx
    lower = texels(y0 + 1, x0) * (1 - fx) + texels(y0 + 1, x0 + 1) * fx
    return upper * (1 - fy) + lower * fy


# ---- use

def set_up(variant: str = "scalar_rgb") -> None:
    """Chooses the variant and registers our plugins; before anything else."""
    mi.set_variant(variant)
    if variant.startswith("scalar"):
        import gltf_bsdf
        import gltf_spot
        gltf_bsdf.register()
        gltf_spot.register()


def load_scene(path: str, width: int, height: int, materials: str = "exact", environment: str | None = None,
               environment_scale: float = 1.0):
    return mi.load_dict(Converter(path, width, height, materials, environment, environment_scale).scene)


def path_integrator(max_depth: int, rr_depth: int = 100000):
    """max_depth counts surface scatterings, as our renderer does; Mitsuba also counts the first segment."""
    return mi.load_dict({"type": "path", "max_depth": max_depth + 1, "rr_depth": rr_depth})


def parse_size(text: str) -> tuple[int, int]:
    width, height = text.lower().split("x")
    return int(width), int(height)


def main() -> int:
    parser = argparse.ArgumentParser(description="Renders a glTF scene with Mitsuba 3 to a PNG.")
    parser.add_argument("scene")
    parser.add_argument("output")
    parser.add_argument("--size", default="320x240", type=parse_size)
    parser.add_argument("--spp", default=16, type=int)
    parser.add_argument("--max-depth", default=12, type=int)
    parser.add_argument("--env")
    parser.add_argument("--materials", default="builtin", choices=["exact", "builtin"])
    parser.add_argument("--variant", default="scalar_rgb")
    arguments = parser.parse_args()
    set_up(arguments.variant)
    scene = load_scene(arguments.scene, *arguments.size, arguments.materials, arguments.env)
    image = mi.render(scene, integrator=path_integrator(arguments.max_depth), spp=arguments.spp)
    mi.util.write_bitmap(arguments.output, image)
    return 0


if __name__ == "__main__":
    sys.exit(main())
