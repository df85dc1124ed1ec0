"""glTF's metallic-roughness material as a Mitsuba BSDF, for the scalar variants.

Mitsuba has no BSDF that equals it: its rough conductor uses another masking term, its principled BSDF other Fresnel
terms. This one is written from the formulas alone:

    f = metallic f_metal + (1 - metallic) f_dielectric
    f_metal      = F_m D G2 / (4 cos_i cos_o),  F_m = base + (1 - base) (1 - v.h)^5
    f_dielectric = T(cos_i) T(cos_o) / T_mean base / pi + F D G2 / (4 cos_i cos_o),  F = F0 + (F90 - F0) (1 - v.h)^5, T = 1 - max(F)
    F0 = min(((ior - 1) / (ior + 1))^2 specular_color, 1) specular,  F90 = specular

with isotropic GGX D, height-correlated Smith G2, and alpha = roughness^2. Below alpha = 1e-4 the specular term is a
perfect mirror. Both sides reflect. Directions below the shading or the geometric horizon get nothing.

Plain Python floats throughout: in a scalar variant they are much faster than vector objects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import mitsuba as mi

DELTA_ALPHA = 1e-4
INV_PI = 1.0 / math.pi
SPECULAR_PROBABILITY_FLOOR = 0.1


@dataclass
class GltfMaterial:
    """Factors and textures of one material; a texture is a Mitsuba texture object, already transformed, or None."""

    base_color: tuple = (1.0, 1.0, 1.0)
    metallic: float = 1.0
    roughness: float = 1.0
    ior: float = 1.5
    specular: float = 1.0
    specular_color: tuple = (1.0, 1.0, 1.0)
    normal_scale: float = 1.0
    base_color_texture: object = None
    metallic_roughness_texture: object = None
    normal_texture: object = None


@dataclass
class Surface:
    """The material's values at one point, and normals in Mitsuba's local frame, on the side of the viewer."""

    base: tuple
    metallic: float
    alpha: float
    f0: tuple
    f90: float
    shading: tuple
    geometric: tuple
    view: tuple
    cos_view: float
    delta: bool = field(default=False)


# Mitsuba passes plugins plain properties only; materials are therefore named by their place in this list.
MATERIALS: list[GltfMaterial] = []


def dot(a, b) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def normalize(a):
    scale = 1.0 / math.sqrt(dot(a, a))
    return (a[0] * scale, a[1] * scale, a[2] * scale)


def basis(normal):
    """Two unit vectors that complete `normal` to an orthonormal frame."""
    helper = (1.0, 0.0, 0.0) if abs(normal[0]) < 0.8 else (0.0, 1.0, 0.0)
    tangent = normalize(cross(helper, normal))
    return tangent, cross(normal, tangent)


def to_world(local, frame):
    s, t, n = frame
    return tuple(local[0] * s[c] + local[1] * t[c] + local[2] * n[c] for c in range(3))


def schlick(f0, f90: float, cosine: float):
    weight = (1.0 - min(max(cosine, 0.0), 1.0)) ** 5
    return tuple(f + (f90 - f) * weight for f in f0)


def ggx_density(alpha: float, cos_half: float) -> float:
    """GGX distribution of normals, per unit solid angle of the macrosurface."""
    a2 = alpha * alpha
    # 1 - cos^2 (1 - a2) with the sine spelled out, exact for small alpha.
    denominator = cos_half * cos_half * a2 + max(0.0, 1.0 - cos_half * cos_half)
    return a2 * INV_PI / (denominator * denominator)


def smith_lambda(alpha: float, cosine: float) -> float:
    c2 = cosine * cosine
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * max(0.0, 1.0 - c2) / c2) - 1.0)


def perturbed_normal(si, material: GltfMaterial):
    """The normal map's normal in Mitsuba's local frame.

    glTF's green axis points up in the picture, towards smaller v: the bitangent is against dp/dv.
    """
    texel = material.normal_texture.eval_3(si)
    x = (2.0 * texel[0] - 1.0) * material.normal_scale
    y = (2.0 * texel[1] - 1.0) * material.normal_scale
    z = 2.0 * texel[2] - 1.0
    dp_du, dp_dv = tuple(si.to_local(si.dp_du)), tuple(si.to_local(si.dp_dv))
    tangent = normalize((dp_du[0], dp_du[1], 0.0))
    bitangent = cross((0.0, 0.0, 1.0), tangent)
    if dot(bitangent, dp_dv) > 0.0:
        bitangent = (-bitangent[0], -bitangent[1], 0.0)
    return normalize(tuple(x * tangent[c] + y * bitangent[c] + (z if c == 2 else 0.0) for c in range(3)))


def surface_at(si, material: GltfMaterial) -> Surface | None:
    """Material and normals at a hit, or None where the viewer is below a horizon."""
    view = tuple(si.wi)
    geometric = tuple(si.to_local(si.n))
    shading = (0.0, 0.0, 1.0) if material.normal_texture is None else perturbed_normal(si, material)
    if dot(shading, geometric) < 0.0:
        shading = tuple(-c for c in shading)
    if dot(view, geometric) < 0.0:
        shading, geometric = tuple(-c for c in shading), tuple(-c for c in geometric)
    cos_view = dot(view, shading)
    if cos_view <= 1e-6 or dot(view, geometric) <= 0.0:
        return None
    return with_material(si, material, shading, geometric, view, cos_view)


def with_material(si, material, shading, geometric, view, cos_view) -> Surface:
    base, metallic, roughness = material.base_color, material.metallic, material.roughness
    if material.base_color_texture is not None:
        texel = material.base_color_texture.eval_3(si)
        base = tuple(base[c] * texel[c] for c in range(3))
    if material.metallic_roughness_texture is not None:
        texel = material.metallic_roughness_texture.eval_3(si)
        roughness *= texel[1]
        metallic *= texel[2]
    ratio = (material.ior - 1.0) / (material.ior + 1.0)
    f0 = tuple(min(ratio * ratio * c, 1.0) * material.specular for c in material.specular_color)
    alpha = roughness * roughness
    return Surface(base, metallic, alpha, f0, material.specular, shading, geometric, view, cos_view,
                   alpha < DELTA_ALPHA)


def specular_color(surface: Surface, cos_view_half: float):
    """The Fresnel terms of both lobes, mixed: they share D and G2."""
    metal = schlick(surface.base, 1.0, cos_view_half)
    coat = schlick(surface.f0, surface.f90, cos_view_half)
    m = surface.metallic
    return tuple(m * metal[c] + (1.0 - m) * coat[c] for c in range(3))


def base_weight(surface: Surface, cos_light: float) -> float:
    """What reaches the base through the coat and leaves it again, over the mean that the coat lets through."""
    def through(cosine):
        return 1.0 - max(schlick(surface.f0, surface.f90, cosine))

    mean = 1.0 - max(f + (surface.f90 - f) / 22.0 for f in surface.f0)
    return (1.0 - surface.metallic) * through(surface.cos_view) * through(cos_light) / max(mean, 1e-6)


def evaluate(surface: Surface, light):
    """BSDF times the light's cosine, without delta parts; and the density of `sample`, per unit solid angle."""
    cos_light = dot(light, surface.shading)
    if cos_light <= 1e-6 or dot(light, surface.geometric) <= 0.0:
        return (0.0, 0.0, 0.0), 0.0
    half = normalize(tuple(light[c] + surface.view[c] for c in range(3)))
    cos_view_half = dot(surface.view, half)
    specular = specular_color(surface, cos_view_half)
    diffuse = base_weight(surface, cos_light) * INV_PI * cos_light
    value = [diffuse * c for c in surface.base]
    probability = specular_probability(surface)
    pdf = (1.0 - probability) * cos_light * INV_PI
    if not surface.delta:
        cos_view, alpha = surface.cos_view, surface.alpha
        density = ggx_density(alpha, dot(half, surface.shading))
        lambda_view, lambda_light = smith_lambda(alpha, cos_view), smith_lambda(alpha, cos_light)
        factor = density / (4.0 * cos_view * (1.0 + lambda_view + lambda_light))
        value = [value[c] + factor * specular[c] for c in range(3)]
        pdf += probability * density / (4.0 * cos_view * (1.0 + lambda_view))
    return value, pdf


def specular_probability(surface: Surface) -> float:
    """How often `sample` takes the specular lobe; any value in (0, 1) is right, a good one has less noise."""
    if surface.metallic >= 1.0:
        return 1.0
    specular = specular_color(surface, surface.cos_view)
    reflected = max(specular)
    diffused = (1.0 - surface.metallic) * max(surface.base)
    if diffused <= 0.0:
        return 1.0
    share = reflected / (reflected + diffused)
    return min(max(share, SPECULAR_PROBABILITY_FLOOR), 1.0 - SPECULAR_PROBABILITY_FLOOR)


def visible_normal(view, alpha: float, u1: float, u2: float):
    """A GGX normal in proportion to its area as `view` sees it; z is the macrosurface's normal.

    By a uniform point on the part of the unit hemisphere that is seen from the stretched direction: a spherical cap.
    """
    stretched = normalize((alpha * view[0], alpha * view[1], view[2]))
    phi = 2.0 * math.pi * u1
    z = (1.0 - u2) * (1.0 + stretched[2]) - stretched[2]
    sine = math.sqrt(max(0.0, 1.0 - z * z))
    summed = (sine * math.cos(phi) + stretched[0], sine * math.sin(phi) + stretched[1], z + stretched[2])
    return normalize((alpha * summed[0], alpha * summed[1], max(summed[2], 1e-12)))


def cosine_direction(u1: float, u2: float):
    radius, phi = math.sqrt(u1), 2.0 * math.pi * u2
    return (radius * math.cos(phi), radius * math.sin(phi), math.sqrt(max(0.0, 1.0 - u1)))


def reflect(view, normal):
    twice = 2.0 * dot(view, normal)
    return tuple(twice * normal[c] - view[c] for c in range(3))


def sample_direction(surface: Surface, specular: bool, u1: float, u2: float):
    """A direction in Mitsuba's local frame."""
    if specular and surface.delta:
        return reflect(surface.view, surface.shading)
    tangent, bitangent = basis(surface.shading)
    frame = (tangent, bitangent, surface.shading)
    if not specular:
        return to_world(cosine_direction(u1, u2), frame)
    view = (dot(surface.view, tangent), dot(surface.view, bitangent), surface.cos_view)
    return to_world(reflect(view, visible_normal(view, surface.alpha, u1, u2)), frame)


class GltfBsdf(mi.BSDF):
    """Property `material`: index into MATERIALS."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.material = MATERIALS[props["material"]]
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        delta = self.material.roughness ** 2 < DELTA_ALPHA
        # A pure metal mirror has no smooth part: Mitsuba must then not sample lights there.
        glossy = mi.BSDFFlags.DeltaReflection if delta else mi.BSDFFlags.GlossyReflection
        self.m_components = [glossy | sides]
        if not (delta and self.material.metallic >= 1.0 and self.material.metallic_roughness_texture is None):
            self.m_components = [glossy | sides, mi.BSDFFlags.DiffuseReflection | sides]
        flags = 0
        for component in self.m_components:
            flags |= int(component)
        self.m_flags = flags

    def sample(self, ctx, si, sample1, sample2, active=True):
        result = mi.BSDFSample3f()
        surface = surface_at(si, self.material)
        if surface is None:
            return result, mi.Color3f(0.0)
        probability = specular_probability(surface)
        specular = sample1 < probability
        direction = sample_direction(surface, specular, sample2[0], sample2[1])
        result.wo = mi.Vector3f(*direction)
        result.eta = 1.0
        if specular and surface.delta:
            return self.delta_sample(surface, direction, probability, result)
        value, pdf = evaluate(surface, direction)
        result.pdf = pdf
        result.sampled_component = 0 if specular else len(self.m_components) - 1
        result.sampled_type = int(mi.BSDFFlags.GlossyReflection if specular else mi.BSDFFlags.DiffuseReflection)
        weight = [component / pdf if pdf > 0.0 else 0.0 for component in value]
        return result, mi.Color3f(*weight)

    def delta_sample(self, surface, direction, probability, result):
        result.pdf = probability
        result.sampled_component = 0
        result.sampled_type = int(mi.BSDFFlags.DeltaReflection)
        if dot(direction, surface.geometric) <= 0.0:
            return result, mi.Color3f(0.0)
        specular = specular_color(surface, surface.cos_view)
        return result, mi.Color3f(*[component / probability for component in specular])

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        surface = surface_at(si, self.material)
        if surface is None:
            return mi.Color3f(0.0), 0.0
        value, pdf = evaluate(surface, tuple(wo))
        return mi.Color3f(*value), pdf

    def to_string(self):
        return f"GltfBsdf[{self.material}]"


def register() -> None:
    mi.register_bsdf("gltf", GltfBsdf)
