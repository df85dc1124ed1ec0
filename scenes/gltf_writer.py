"""Writes binary glTF 2.0 files (.glb) with the standard library alone.

The bytes depend on the calls only: no dates, no hash order, floats rounded the same way everywhere.
Lengths are metres, angles radians, light intensities W/sr (point, spot) or W/m^2 (directional),
emission W/(m^2 sr), colours linear Rec. 709.
"""

from __future__ import annotations

import json
import os
import struct
import sys
import zlib
from array import array
from dataclasses import dataclass, field

FLOAT = 5126
UNSIGNED_SHORT = 5123
UNSIGNED_INT = 5125
ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963
REPEAT = 10497
MIRRORED_REPEAT = 33648
CLAMP_TO_EDGE = 33071
LINEAR = 9729
NEAREST = 9728


@dataclass
class Geometry:
    """One indexed triangle mesh; flat arrays of floats and of vertex indices."""

    positions: array = field(default_factory=lambda: array("f"))  # x, y, z in metres
    normals: array = field(default_factory=lambda: array("f"))  # unit vectors, or empty
    uvs: array = field(default_factory=lambda: array("f"))  # u, v, or empty
    indices: array = field(default_factory=lambda: array("I"))

    def vertex_count(self) -> int:
        return len(self.positions) // 3

    def triangle_count(self) -> int:
        return len(self.indices) // 3

    def add_vertex(self, position, normal=None, uv=None) -> int:
        """Appends a vertex and returns its index."""
        self.positions.extend(position)
        if normal is not None:
            self.normals.extend(normal)
        if uv is not None:
            self.uvs.extend(uv)
        return self.vertex_count() - 1


def encode_png(width: int, height: int, pixels: bytes, channels: int = 3) -> bytes:
    """An 8-bit PNG of 1 (grey), 3 (RGB) or 4 (RGBA) interleaved channels, row 0 at the top."""
    if len(pixels) != width * height * channels:
        raise ValueError(f"a {width}x{height} picture of {channels} channels does not have {len(pixels)} bytes")
    colour_type = {1: 0, 3: 2, 4: 6}[channels]
    stride = width * channels
    rows = b"".join(b"\0" + pixels[y * stride : (y + 1) * stride] for y in range(height))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def rounded(value):
    """Numbers of a JSON tree with at most 9 significant digits: what a 32-bit float can hold, and no noise after it."""
    if isinstance(value, float):
        return float(f"{value:.9g}")
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return value


class GltfBuilder:
    """Collects meshes, materials, nodes, cameras, lights and textures, and writes them as one .glb file.

    Every add_ function returns the index of the new element.
    """

    def __init__(self) -> None:
        self.binary = bytearray()
        self.document: dict = {"asset": {"version": "2.0", "generator": "nephroid scenes"}}
        self.root_nodes: list[int] = []
        self.triangles = 0

    # ---- building blocks

    def add(self, collection: str, element: dict) -> int:
        self.document.setdefault(collection, []).append(element)
        return len(self.document[collection]) - 1

    def use_extension(self, name: str, required: bool = False) -> None:
        for key in ["extensionsUsed"] + (["extensionsRequired"] if required else []):
            names = self.document.setdefault(key, [])
            if name not in names:
                names.append(name)

    def add_buffer_view(self, data: bytes, target: int | None = None) -> int:
        self.binary.extend(b"\0" * (-len(self.binary) % 4))
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self.binary.extend(data)
        return self.add("bufferViews", view)

    def add_float_accessor(self, values: array, components: int, with_bounds: bool = False) -> int:
        view = self.add_buffer_view(little_endian(values), ARRAY_BUFFER)
        accessor = {
            "bufferView": view,
            "componentType": FLOAT,
            "count": len(values) // components,
            "type": {2: "VEC2", 3: "VEC3", 4: "VEC4"}[components],
        }
        if with_bounds:
            accessor["min"] = [min(values[c::components]) for c in range(components)]
            accessor["max"] = [max(values[c::components]) for c in range(components)]
        return self.add("accessors", accessor)

    def add_index_accessor(self, indices: array, vertex_count: int) -> int:
        # 65535 itself is the primitive restart value, which glTF forbids.
        short = vertex_count <= 65535
        data = little_endian(array("H" if short else "I", indices))
        view = self.add_buffer_view(data, ELEMENT_ARRAY_BUFFER)
        component_type = UNSIGNED_SHORT if short else UNSIGNED_INT
        accessor = {"bufferView": view, "componentType": component_type, "count": len(indices), "type": "SCALAR"}
        return self.add("accessors", accessor)

    # ---- scene elements

    def add_mesh(self, name: str, geometry: Geometry, material: int) -> int:
        attributes = {"POSITION": self.add_float_accessor(geometry.positions, 3, with_bounds=True)}
        if geometry.normals:
            attributes["NORMAL"] = self.add_float_accessor(geometry.normals, 3)
        if geometry.uvs:
            attributes["TEXCOORD_0"] = self.add_float_accessor(geometry.uvs, 2)
        indices = self.add_index_accessor(geometry.indices, geometry.vertex_count())
        self.triangles += geometry.triangle_count()
        return self.add("meshes", {"name": name, "primitives": [
            {"attributes": attributes, "indices": indices, "material": material}]})

    def add_material(self, name: str, base_color=(1.0, 1.0, 1.0), metallic: float = 0.0, roughness: float = 1.0,
                     emission=None, emission_strength: float = 1.0, specular: float | None = None,
                     specular_color=None, ior: float | None = None, base_color_texture: dict | None = None,
                     metallic_roughness_texture: dict | None = None, normal_texture: dict | None = None,
                     emissive_texture: dict | None = None, double_sided: bool = False,
                     extensions: dict | None = None) -> int:
        """Metallic-roughness material; alpha is roughness^2. `specular` = 0 makes the base exactly Lambert."""
        pbr = {"baseColorFactor": [*base_color, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
        if base_color_texture:
            pbr["baseColorTexture"] = base_color_texture
        if metallic_roughness_texture:
            pbr["metallicRoughnessTexture"] = metallic_roughness_texture
        material: dict = {"name": name, "pbrMetallicRoughness": pbr}
        if normal_texture:
            material["normalTexture"] = normal_texture
        if emission is not None:
            material["emissiveFactor"] = list(emission)
        if emissive_texture:
            material["emissiveTexture"] = emissive_texture
        if double_sided:
            material["doubleSided"] = True
        extensions = dict(extensions or {})
        if emission is not None and emission_strength != 1.0:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": emission_strength}
        if specular is not None or specular_color is not None:
            extension = extensions.setdefault("KHR_materials_specular", {})
            if specular is not None:
                extension["specularFactor"] = specular
            if specular_color is not None:
                extension["specularColorFactor"] = list(specular_color)
        if ior is not None:
            extensions["KHR_materials_ior"] = {"ior": ior}
        for extension_name in extensions:
            self.use_extension(extension_name)
        if extensions:
            material["extensions"] = extensions
        return self.add("materials", material)

    def add_texture(self, name: str, png: bytes, wrap_u: int = REPEAT, wrap_v: int = REPEAT,
                    filter_mode: int = LINEAR) -> int:
        image = self.add("images", {"name": name, "bufferView": self.add_buffer_view(png), "mimeType": "image/png"})
        sampler = self.add("samplers", {"magFilter": filter_mode, "minFilter": filter_mode,
                                        "wrapS": wrap_u, "wrapT": wrap_v})
        return self.add("textures", {"name": name, "source": image, "sampler": sampler})

    def texture_slot(self, texture: int, offset=None, rotation: float | None = None, scale=None, **extra) -> dict:
        """How a material slot names a texture; offset (u, v), rotation (radians) and scale: KHR_texture_transform.

        extra: `scale` is taken by the transform, so a normal map's strength is given as normal_scale.
        """
        slot: dict = {"index": texture}
        if "normal_scale" in extra:
            slot["scale"] = extra["normal_scale"]
        transform = {}
        if offset is not None:
            transform["offset"] = list(offset)
        if rotation is not None:
            transform["rotation"] = rotation
        if scale is not None:
            transform["scale"] = list(scale)
        if transform:
            self.use_extension("KHR_texture_transform")
            slot["extensions"] = {"KHR_texture_transform": transform}
        return slot

    def add_node(self, name: str, parent: int | None = None, translation=None, rotation=None, scale=None, matrix=None,
                 mesh: int | None = None, camera: int | None = None, light: int | None = None,
                 extras: dict | None = None) -> int:
        """A node; rotation is a unit quaternion (x, y, z, w), matrix 16 numbers column by column."""
        node: dict = {"name": name}
        for key, value in [("translation", translation), ("rotation", rotation), ("scale", scale), ("matrix", matrix)]:
            if value is not None:
                node[key] = list(value)
        if mesh is not None:
            node["mesh"] = mesh
        if camera is not None:
            node["camera"] = camera
        if light is not None:
            node["extensions"] = {"KHR_lights_punctual": {"light": light}}
        if extras:
            node["extras"] = extras
        index = self.add("nodes", node)
        if parent is None:
            self.root_nodes.append(index)
        else:
            self.document["nodes"][parent].setdefault("children", []).append(index)
        return index

    def add_perspective_camera(self, name: str, position, target, vertical_fov: float, aspect: float,
                               up=(0.0, 1.0, 0.0)) -> int:
        """A camera at `position` that looks at `target`; vertical_fov in radians. Returns the node."""
        camera = self.add("cameras", {"name": name, "type": "perspective", "perspective": {
            "yfov": vertical_fov, "aspectRatio": aspect, "znear": 0.01, "zfar": 1000.0}})
        return self.add_node(name, matrix=look_at(position, target, up), camera=camera)

    def add_orthographic_camera(self, name: str, position, target, half_width: float, half_height: float,
                                up=(0.0, 1.0, 0.0)) -> int:
        """A parallel projection of 2 half_width x 2 half_height metres. Returns the node."""
        camera = self.add("cameras", {"name": name, "type": "orthographic", "orthographic": {
            "xmag": half_width, "ymag": half_height, "znear": 0.01, "zfar": 1000.0}})
        return self.add_node(name, matrix=look_at(position, target, up), camera=camera)

    def add_light(self, name: str, kind: str, intensity: float, color=(1.0, 1.0, 1.0), position=None, target=None,
                  radius: float | None = None, inner_angle: float | None = None,
                  outer_angle: float | None = None) -> int:
        """A light of KHR_lights_punctual with its node: kind is point, spot or directional.

        intensity: W/sr, or W/m^2 where directional. target: where spot and directional lights shine to.
        radius (metres) makes a point light a sphere of the same intensity. Angles (radians) are half angles of a spot.
        """
        light: dict = {"name": name, "type": kind, "color": list(color), "intensity": intensity}
        if kind == "spot":
            light["spot"] = {"innerConeAngle": inner_angle, "outerConeAngle": outer_angle}
        if radius is not None:
            light["extras"] = {"radius": radius}
        self.use_extension("KHR_lights_punctual")
        lights = self.document.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        index = len(lights) - 1
        position = position or (0.0, 0.0, 0.0)
        if target is None:
            return self.add_node(name, translation=position, light=index)
        return self.add_node(name, matrix=look_at(position, target, up_for(position, target)), light=index)

    # ---- output

    def to_bytes(self) -> bytes:
        document = dict(self.document)
        document["scene"] = 0
        document["scenes"] = [{"nodes": self.root_nodes}]
        document["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(rounded(document), separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        length = 12 + 8 + len(text) + 8 + len(binary)
        return b"".join([struct.pack("<III", 0x46546C67, 2, length), struct.pack("<II", len(text), 0x4E4F534A), text,
                         struct.pack("<II", len(binary), 0x004E4942), binary])

    def write(self, path: str) -> None:
        """Writes the file whole or not at all: a reader never sees half of it."""
        temporary = f"{path}.{os.getpid()}.tmp"
        with open(temporary, "wb") as file:
            file.write(self.to_bytes())
        os.replace(temporary, path)


def little_endian(values: array) -> bytes:
    if sys.byteorder == "big":
        values = array(values.typecode, values)
        values.byteswap()
    return values.tobytes()


def subtract(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def normalize(a):
    length = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) ** 0.5
    return [a[0] / length, a[1] / length, a[2] / length]


def up_for(position, target):
    """An up vector that is not parallel to the viewing direction."""
    direction = normalize(subtract(target, position))
    return (0.0, 1.0, 0.0) if abs(direction[1]) < 0.9 else (0.0, 0.0, 1.0)


def look_at(position, target, up) -> list[float]:
    """Column-major node matrix whose -Z axis points from position to target, as glTF cameras and lights look."""
    z = normalize(subtract(position, target))
    x = normalize(cross(up, z))
    y = cross(z, x)
    return [*x, 0.0, *y, 0.0, *z, 0.0, *position, 1.0]
