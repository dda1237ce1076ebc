# SPDX-License-Identifier: GPL-3.0-or-later
"""The Principled BSDF of all versions of Blender: 26 inputs before 4.0, 30 since 4.0, more since 4.3."""

from __future__ import annotations

import math
from typing import Any, Callable

import numpy as np

from .colors import ColorReader
from .fields import Field, computed, constant, is_constant_of, scaled
from .nodes import Source, named
from .report import Fidelity
from .surfaces import Model, Shader, mixed

# Roughness of glass up to which it agrees with Cycles' under lamps.
SMOOTH = 0.2
# Names of an input, the newest first.
NAMES: dict[str, tuple[str, ...]] = {
    "base": ("Base Color",),
    "metallic": ("Metallic",),
    "roughness": ("Roughness",),
    "ior": ("IOR",),
    "alpha": ("Alpha",),
    "normal": ("Normal",),
    "subsurface": ("Subsurface Weight", "Subsurface"),
    "subsurface_color": ("Subsurface Color",),
    "subsurface_radius": ("Subsurface Radius",),
    "subsurface_scale": ("Subsurface Scale",),
    "subsurface_ior": ("Subsurface IOR",),
    "subsurface_g": ("Subsurface Anisotropy",),
    "specular": ("Specular IOR Level", "Specular"),
    "specular_tint": ("Specular Tint",),
    "anisotropic": ("Anisotropic",),
    "rotation": ("Anisotropic Rotation",),
    "transmission": ("Transmission Weight", "Transmission"),
    "transmission_roughness": ("Transmission Roughness",),
    "coat": ("Coat Weight", "Clearcoat"),
    "coat_roughness": ("Coat Roughness", "Clearcoat Roughness"),
    "coat_ior": ("Coat IOR",),
    "coat_tint": ("Coat Tint",),
    "sheen": ("Sheen Weight", "Sheen"),
    "sheen_roughness": ("Sheen Roughness",),
    "sheen_tint": ("Sheen Tint",),
    "emission": ("Emission Color", "Emission"),
    "strength": ("Emission Strength",),
    "film": ("Thin Film Thickness",),
    "film_ior": ("Thin Film IOR",),
    "diffuse_roughness": ("Diffuse Roughness",),
}


def principled(reader: ColorReader, source: Source, note: Callable[[Any, Fidelity, str], None]) -> Shader:
    """Returns the shader of a Principled BSDF."""
    node, groups = source.node, source.groups
    is_old = not any(socket.name == "Specular IOR Level" for socket in node.inputs)

    def number(name: str, otherwise: float) -> Field:
        return reader.number(named(node, groups, *NAMES[name]), otherwise)

    def color(name: str, otherwise: float) -> Field:
        return reader.color(named(node, groups, *NAMES[name]), otherwise)

    base, metallic, roughness = color("base", 0.8), number("metallic", 0.0), number("roughness", 0.5)
    transmission = number("transmission", 0.0)
    fields: dict[str, Any] = {"base_color": base, "metallic": metallic, "roughness": roughness}
    if node.distribution == "GGX" and not is_constant_of(roughness, 0.0):
        note(node, Fidelity.APPROXIMATED, "facets scatter more than once, as those of Multiscatter GGX")
    if is_old and not is_constant_of(metallic, 1.0):
        note(node, Fidelity.APPROXIMATED, "the matte part is Lambert's; before 4.0 it is brighter or darker at its edges, by roughness")
    _specular(fields, node, is_old, number, color, note)
    _anisotropy(fields, node, number, note)
    _coat(fields, node, is_old, number, color, note)
    _sheen(fields, node, is_old, number, color, base, note)
    _film(fields, node, number, note)
    if not is_constant_of(number("subsurface", 0.0), 0.0):
        _subsurface_color(fields, is_old, number, color, base)
        _subsurface(fields, node, is_old, number, color, note)
    if not is_constant_of(number("diffuse_roughness", 0.0), 0.0):
        note(node, Fidelity.APPROXIMATED, "Diffuse Roughness is rendered as 0")
    emission = scaled(color("emission", 0.0), number("strength", 1.0 if is_old else 0.0))
    alpha = number("alpha", 1.0)
    opaque = Shader(Model("Layered", fields), emission, alpha)
    if is_constant_of(transmission, 0.0):
        return opaque
    glass = _glass(fields, node, is_old, number, base, note)
    return mixed(transmission, opaque, Shader(Model("Layered", glass), emission, alpha))


def _glass(fields: dict[str, Any], node: Any, is_old: bool, number: Any, base: Field, note: Any) -> dict[str, Any]:
    """Returns the fields of the part that transmits."""
    glass = {name: value for name, value in fields.items() if name not in ("specular", "subsurface")}
    # Since 4.0 the color is that of light that has entered and left.
    color = base if is_old else computed("root", 3, lambda value: value.clip(0.0, None) ** 0.5, base)
    glass.update(base_color=color, transmission=constant(1.0), ior=max(_ior(node, number, note), 1.0))
    roughness = glass["roughness"]
    if not (roughness.is_constant and float(np.max(roughness.load())) <= SMOOTH + 1e-6):
        note(node, Fidelity.APPROXIMATED, "rough glass is brighter below lamps: its facets scatter light more than once")
    if is_old and not is_constant_of(number("transmission_roughness", 0.0), 0.0):
        note(node, Fidelity.APPROXIMATED, "Transmission Roughness is rendered as the roughness")
    return glass


def _ior(node: Any, number: Any, note: Any) -> float:
    ior = number("ior", 1.5)
    if ior.is_constant:
        return float(ior.number())
    note(node, Fidelity.APPROXIMATED, "an IOR that varies is rendered as 1.5")
    return 1.5


def _specular(fields: dict[str, Any], node: Any, is_old: bool, number: Any, color: Any, note: Any) -> None:
    # Before 4.0 the reflection of opaque surfaces came from Specular alone: F0 = 0.08 × Specular.
    eta, level = 1.5 if is_old else max(_ior(node, number, note), 1.0), number("specular", 0.5)
    if level.is_constant:
        # The level scales the reflection at a right angle.
        f0 = ((eta - 1.0) / (eta + 1.0)) ** 2
        wanted = min(f0 * 2.0 * level.number(), 0.99)
        fields["ior"] = (1.0 + math.sqrt(wanted)) / (1.0 - math.sqrt(wanted))
    else:
        fields["ior"] = eta
        fields["specular"] = computed("level", 1, lambda value: (2.0 * value).clip(0.0, 1.0), level)
        note(node, Fidelity.APPROXIMATED, "a Specular IOR Level that varies is at most 0.5")
    if is_old:
        if not is_constant_of(number("specular_tint", 0.0), 0.0):
            note(node, Fidelity.APPROXIMATED, "Specular Tint is rendered as 0")
    else:
        tint = color("specular_tint", 1.0)
        if not is_constant_of(tint, 1.0):
            fields["specular_color"] = tint
            if not is_constant_of(fields["metallic"], 0.0):
                note(node, Fidelity.APPROXIMATED, "Specular Tint tints no edges of metal")


def _anisotropy(fields: dict[str, Any], node: Any, number: Any, note: Any) -> None:
    strength, rotation = number("anisotropic", 0.0), number("rotation", 0.0)
    if is_constant_of(strength, 0.0):
        return
    if not (strength.is_constant and rotation.is_constant):
        note(node, Fidelity.LEFT_OUT, "anisotropy that varies is rendered as 0")
        return
    note(node, Fidelity.APPROXIMATED, "anisotropy follows the texture coordinates, and its strength is as in glTF")
    fields["anisotropy"] = (abs(strength.number()), 2.0 * math.pi * rotation.number())


def _coat(fields: dict[str, Any], node: Any, is_old: bool, number: Any, color: Any, note: Any) -> None:
    coat = number("coat", 0.0)
    if is_constant_of(coat, 0.0):
        return
    # Before 4.0 the coat was a quarter as strong.
    fields["coat"] = scaled(coat, constant(0.25)) if is_old else coat
    fields["coat_roughness"] = number("coat_roughness", 0.03)
    if not is_constant_of(color("coat_tint", 1.0), 1.0):
        note(node, Fidelity.APPROXIMATED, "Coat Tint is rendered as white")
    if not is_constant_of(number("coat_ior", 1.5), 1.5):
        note(node, Fidelity.APPROXIMATED, "Coat IOR is rendered as 1.5")


def _sheen(fields: dict[str, Any], node: Any, is_old: bool, number: Any, color: Any, base: Field, note: Any) -> None:
    sheen = number("sheen", 0.0)
    if is_constant_of(sheen, 0.0):
        return
    tint = constant(1.0, 1.0, 1.0) if is_old else color("sheen_tint", 1.0)
    fields["sheen_color"] = scaled(tint, sheen)
    fields["sheen_roughness"] = number("sheen_roughness", 0.5)
    note(node, Fidelity.APPROXIMATED, "sheen is that of glTF (Charlie), not Cycles' microfibers")


def _film(fields: dict[str, Any], node: Any, number: Any, note: Any) -> None:
    film, ior = number("film", 0.0), number("film_ior", 1.33)
    if is_constant_of(film, 0.0):
        return
    if not film.is_constant or not ior.is_constant:
        note(node, Fidelity.LEFT_OUT, "a thin film that varies is left out")
        return
    fields["iridescence"] = (film.number(), ior.number())
    note(node, Fidelity.APPROXIMATED, "a thin film is that of glTF: up to 7 % darker, and its colors differ")


def _subsurface(fields: dict[str, Any], node: Any, is_old: bool, number: Any, color: Any, note: Any) -> None:
    weight, radius = number("subsurface", 0.0), color("subsurface_radius", 1.0)
    # Before 4.0 the weight scaled the radius instead.
    weight, scale = (constant(1.0), weight) if is_old else (weight, number("subsurface_scale", 0.05))
    ior, g = number("subsurface_ior", 1.4), number("subsurface_g", 0.0)
    fields["subsurface"] = subsurface_model(node, node.subsurface_method, is_old, weight, scaled(radius, scale), ior, g, note)


# The mean free path of Cycles' walks with a fixed radius, over the radius.
FIXED_RADIUS = 0.25 / math.pi


def subsurface_model(node: Any, method: str, is_old: bool, weight: Field, radius: Field, ior: Field, g: Field, note: Any) -> Model:
    """Returns what lies below a surface, by one of Cycles' methods."""
    walk = "Christensen-Burley is rendered as a random walk; a" if method == "BURLEY" else "a"
    note(node, Fidelity.APPROXIMATED, f"{walk} thick body below the surface has the base color; Cycles' is up to 3 % brighter")
    if not (ior.is_constant and g.is_constant):
        note(node, Fidelity.APPROXIMATED, "a Subsurface IOR or Anisotropy that varies is rendered as 1.4 and 0")
    members: dict[str, Any] = {"weight": weight, "g": min(max(g.number() if g.is_constant else 0.0, -0.95), 0.95)}
    if method == ("RANDOM_WALK" if is_old else "RANDOM_WALK_SKIN"):
        note(node, Fidelity.APPROXIMATED, "light enters diffusely, not refracted by Subsurface IOR")
        return Model("Subsurface", members | {"radius": radius, "radius_ior": max(ior.number() if ior.is_constant else 1.4, 1.01)})
    return Model("Subsurface", members | {"radius": scaled(radius, constant(FIXED_RADIUS))})


def _subsurface_color(fields: dict[str, Any], is_old: bool, number: Any, color: Any, base: Field) -> None:
    """Before 4.0 the matte part had a color of its own."""
    if not is_old:
        return
    share, own = number("subsurface", 0.0), color("subsurface_color", 0.8)
    fields["base_color"] = computed("subsurface", 3, lambda s, a, b: a + s.clip(0, 1) * (b - a), share, base, own)
