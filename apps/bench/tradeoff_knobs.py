"""What tradeoff.py sweeps: settings of `guided`, and two properties of the scene."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from dataclasses import dataclass, field

from bench_environment import SCENES_FOLDER
from bench_runs import file_name, scene_name


@dataclass
class Knob:
    """values: as the renderer takes them, in the order of the plots; fixed: settings without which the knob is idle."""

    meaning: str
    values: list[str]
    default: str | None = None
    key: str = ""
    fixed: list[str] = field(default_factory=list)

    def settings(self, value: str) -> list[str]:
        return [*self.fixed, f"{self.key}={value}"]


def knob(key: str, meaning: str, values: str, default: str | None = None, fixed: list[str] | None = None) -> Knob:
    return Knob(meaning, values.split(), default, key, fixed or [])


KNOBS: dict[str, Knob] = {
    "cached_points": knob("cached_points", "points of the picture that get a mixture of lobes",
                          "500 1000 2000 5000 10000 20000 40000", "10000"),
    "slope_limit": knob("slope_limit", "the largest slope, in units of alpha, of a path that becomes a lobe",
                        "1 2 4 6 10 20", "6"),
    "epsilon": knob("epsilon", "where a glossy lobe ends to count (Eq. 1 of Li et al. 2022), with slope_limit=0",
                    "0.0001 0.001 0.01 0.1 0.5", "0.01", ["slope_limit=0"]),
    "bounces": knob("bounces", "reflections of the longest searched paths, with long_paths=search", "1 2 3", None,
                    ["long_paths=search"]),
    "long_paths": knob("long_paths", "how light of two and more reflections is found", "photons search", "photons"),
    "photons": knob("photons", "photons for each cached point", "0 8 16 32 64 128", "32"),
    "guide_fraction": knob("guide_fraction", "the guide's probability against the BSDF's",
                           "auto 0.1 0.25 0.5 0.75 0.9", "auto"),
    "adaptive": knob("adaptive", "more paths for pixels that deviate more", "on off", "on"),
    "merge_distance": knob("merge_distance", "distance in triangle edges below which paths share a lobe",
                           "0 0.03 0.1 0.3 1 3", "0.1"),
    "search_seconds": knob("search_seconds", "processor seconds that the search may take before points are left out",
                           "1 2 5 10 20", "5"),
    "search_share": knob("search_share", "share of the time after which the search ends (equal time only)",
                         "0.1 0.2 0.3 0.5 0.7", "0.3"),
    "lobe": knob("lobe", "kind of lobe: slope space, or the paper's spherical Gaussians", "slope sg", "slope"),
    "warp_slope": knob("warp", "how slope lobes move to the shading point", "newton implicit none", "newton"),
    "warp_sg": knob("warp", "how spherical Gaussians move to the shading point, with lobe=sg", "mirror none", None,
                    ["lobe=sg"]),
    "newton": knob("newton", "specular points by Newton's method, or triangles' centres", "on off", "on"),
    "selection": knob("selection", "which paths become lobes", "minima triangles", "minima"),
    "preset": knob("preset", "our defaults, or the paper's method", "default paper", "default"),
    "alpha": Knob("GGX width of the caster", "0.001 0.002 0.005 0.01 0.02 0.05 0.1 0.2".split()),
    "light_radius": Knob("radius of the light, metres (0: a point)", "0 0.002 0.005 0.01 0.02 0.05 0.1 0.2".split()),
}
SCENE_KNOBS = ("alpha", "light_radius")


def scene_variant(knob_name: str, value: str, scene: str, folder: str) -> str:
    """Makes the scene with another alpha or light radius in the folder; ValueError where the scene has no such knob."""
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, f"{scene_name(scene)}_{knob_name}_{file_name(value)}.glb")
    if knob_name == "alpha":
        make_with_alpha(scene, value, path)
    else:
        with open(scene, "rb") as file:
            data = with_light_radius(file.read(), float(value))
        temporary = f"{path}.{os.getpid()}.tmp"
        with open(temporary, "wb") as file:
            file.write(data)
        os.replace(temporary, path)
    return path


def make_with_alpha(scene: str, alpha: str, path: str) -> None:
    generator = os.path.join(SCENES_FOLDER, scene_name(scene) + ".py")
    if not os.path.isfile(generator):
        raise ValueError("it has no generator in scenes/")
    result = subprocess.run([sys.executable, "-B", generator, path, "--alpha", alpha], capture_output=True, text=True)
    if result.returncode != 0 or not os.path.isfile(path):
        raise ValueError(f"its generator takes no --alpha: {(result.stderr.splitlines() or ['no message'])[-1]}")


def with_light_radius(data: bytes, radius: float) -> bytes:
    """The .glb with every point light made a sphere of this radius (metres) and the same intensity; 0: a point."""
    magic, version, _ = struct.unpack_from("<III", data)
    length, kind = struct.unpack_from("<II", data, 12)
    if magic != 0x46546C67 or version != 2 or kind != 0x4E4F534A:
        raise ValueError("not a binary glTF 2.0 file")
    document = json.loads(data[20:20 + length])
    lights = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    points = [light for light in lights if light["type"] == "point"]
    if not points:
        raise ValueError("it has no point light")
    for light in points:
        extras = {key: item for key, item in light.pop("extras", {}).items() if key != "radius"}
        if radius > 0.0:
            extras["radius"] = radius
        if extras:
            light["extras"] = extras
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length:]
    return struct.pack("<IIIII", magic, version, 20 + len(text) + len(rest), len(text), kind) + text + rest
