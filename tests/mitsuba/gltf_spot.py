"""KHR_lights_punctual's spot light as a Mitsuba emitter, for the scalar variants.

Mitsuba's own spot falls off linearly in the angle; glTF's in the square of a ramp over the cosine:
intensity * clamp((cos - cos_outer) / max(0.001, cos_inner - cos_outer), 0, 1)^2.
"""

from __future__ import annotations

import math

import mitsuba as mi


class GltfSpot(mi.Emitter):
    """Properties: position and direction (world, metres), intensity (W/sr), inner and outer half angle (radians)."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.position = [float(c) for c in props["position"]]
        self.direction = [float(c) for c in props["direction"]]
        self.intensity = [props["red"], props["green"], props["blue"]]
        self.cos_outer = math.cos(props["outer"])
        self.ramp = max(0.001, math.cos(props["inner"]) - self.cos_outer)
        self.m_flags = int(mi.EmitterFlags.DeltaPosition)

    def attenuation(self, cosine: float) -> float:
        return min(max((cosine - self.cos_outer) / self.ramp, 0.0), 1.0) ** 2

    def sample_direction(self, it, sample, active=True):
        offset = [self.position[c] - it.p[c] for c in range(3)]
        distance = math.sqrt(sum(c * c for c in offset))
        to_light = [c / distance for c in offset]
        result = mi.DirectionSample3f()
        result.p = mi.Point3f(*self.position)
        result.n = mi.Normal3f(0, 0, 0)
        result.uv = mi.Point2f(0, 0)
        result.time = it.time
        result.pdf = 1.0
        result.delta = True
        result.emitter = self
        result.d = mi.Vector3f(*to_light)
        result.dist = distance
        cosine = -sum(to_light[c] * self.direction[c] for c in range(3))
        scale = self.attenuation(cosine) / (distance * distance)
        return result, mi.Color3f(*[scale * c for c in self.intensity])

    def pdf_direction(self, it, ds, active=True):
        return 0.0

    def eval(self, si, active=True):
        return mi.Color3f(0.0)

    def eval_direction(self, it, ds, active=True):
        return mi.Color3f(0.0)

    def bbox(self):
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(*self.position))

    def to_string(self):
        return "GltfSpot[]"


def register() -> None:
    mi.register_emitter("gltf_spot", GltfSpot)
