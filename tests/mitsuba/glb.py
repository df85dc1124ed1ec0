"""A small reader for .glb files, written apart from the renderer's loader so that the two can disagree.

It reads what the comparison scenes use: one buffer, float vertex attributes, embedded PNG pictures.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

import numpy

COMPONENT_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass
class PlacedNode:
    """A node of the scene with its transform to the world (4x4, column vectors)."""

    name: str
    node: dict
    to_world: numpy.ndarray


class Glb:
    """A parsed .glb: `document` is the JSON tree, the functions resolve what it refers to."""

    def __init__(self, path: str) -> None:
        with open(path, "rb") as file:
            data = file.read()
        magic, version, length = struct.unpack_from("<III", data)
        if magic != 0x46546C67 or version != 2 or length != len(data):
            raise ValueError(f"{path}: not a glTF 2.0 binary file")
        json_length, _ = struct.unpack_from("<II", data, 12)
        self.document = json.loads(data[20 : 20 + json_length])
        self.binary = data[20 + json_length + 8 :]

    def extension(self, element: dict, name: str) -> dict:
        return element.get("extensions", {}).get(name, {})

    def buffer_view(self, index: int) -> bytes:
        view = self.document["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.binary[start : start + view["byteLength"]]

    def accessor(self, index: int) -> numpy.ndarray:
        """The accessor's values, one row per element."""
        accessor = self.document["accessors"][index]
        components = COMPONENT_COUNTS[accessor["type"]]
        values = numpy.frombuffer(self.buffer_view(accessor["bufferView"]), COMPONENT_TYPES[accessor["componentType"]],
                                  accessor["count"] * components, accessor.get("byteOffset", 0))
        return values.reshape(accessor["count"], components)

    def placed_nodes(self) -> list[PlacedNode]:
        """All nodes of the default scene, depth first."""
        found: list[PlacedNode] = []

        def visit(index: int, parent: numpy.ndarray) -> None:
            node = self.document["nodes"][index]
            to_world = parent @ node_matrix(node)
            found.append(PlacedNode(node.get("name", f"node {index}"), node, to_world))
            for child in node.get("children", []):
                visit(child, to_world)

        for root in self.document["scenes"][self.document.get("scene", 0)]["nodes"]:
            visit(root, numpy.eye(4))
        return found


def node_matrix(node: dict) -> numpy.ndarray:
    """A node's own transform: its matrix, or translation * rotation * scale."""
    if "matrix" in node:
        return numpy.array(node["matrix"], dtype=float).reshape(4, 4).T
    matrix = numpy.eye(4)
    matrix[:3, :3] = rotation_matrix(node.get("rotation", [0, 0, 0, 1])) * numpy.array(node.get("scale", [1, 1, 1]))
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def rotation_matrix(quaternion) -> numpy.ndarray:
    x, y, z, w = quaternion
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
