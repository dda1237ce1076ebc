# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for shaders."""

from __future__ import annotations

from typing import Any, Callable

from .colors import ColorReader
from .fields import CannotFold, constant, is_constant_of, scaled
from .hair import hair_shader
from .nodes import CyclicNodes, Input, Source, named
from .principled import principled, subsurface_model
from .report import Fidelity
from .surfaces import BLACK, CLEAR, ONE, Model, Relief, Shader, added, mixed, with_relief

MOST_DEPTH = 60


class ShaderReader:
    """Reads shaders from inputs of nodes."""

    def __init__(self, reader: ColorReader) -> None:
        self.reader, self.note = reader, reader.note
        self._depth = 0

    def shader(self, found: Input | None) -> Shader:
        """Returns the shader of an input. Raises `CyclicNodes`."""
        source = found.source() if found is not None else None
        if source is None:
            # Nothing: black, and it emits nothing.
            return Shader()
        if self._depth >= MOST_DEPTH:
            raise CyclicNodes("the shaders feed themselves")
        self._depth += 1
        try:
            return self._of(source, found)
        except CannotFold as error:
            self.note(source.node, Fidelity.APPROXIMATED, f"{error}; the first shader is rendered alone")
            return self.shader(self._first_shader(source))
        finally:
            self._depth -= 1

    def _of(self, source: Source, found: Input | None) -> Shader:
        made = _READERS.get(source.node.bl_idname)
        if made is not None:
            return with_relief(made(self, source), self.relief(source))
        if source.output.type != "SHADER":
            # A color that feeds a shader emits.
            return Shader(emission=self.reader.color(found))
        self.note(source.node, Fidelity.LEFT_OUT, f"the shader {source.node.bl_label} is rendered as matte gray")
        return Shader(Model("Diffuse", {"reflectance": self.reader.color_at(source, "Color")}))

    def _first_shader(self, source: Source) -> Input | None:
        first = next((socket for socket in source.node.inputs if socket.type == "SHADER" and socket.is_linked), None)
        return Input(first, source.groups) if first is not None else None

    def relief(self, source: Source) -> Relief | None:
        """Returns the relief of the input Normal of a shader."""
        found = named(source.node, source.groups, "Normal")
        normal = found.source() if found is not None else None
        if normal is None:
            return None
        if normal.node.bl_idname == "ShaderNodeNormalMap":
            return self._normal_map(normal)
        if normal.node.bl_idname == "ShaderNodeBump":
            return self._bump(normal)
        if normal.node.bl_idname not in ("ShaderNodeNewGeometry", "ShaderNodeTexCoord"):
            self.note(normal.node, Fidelity.LEFT_OUT, "normals from this node are those of the mesh")
        return None

    def _normal_map(self, source: Source) -> Relief | None:
        node = source.node
        strength = self.reader.at(source, "Strength", 1.0)
        color = self.reader.color(named(node, source.groups, "Color"))
        if color.is_constant:
            return None
        if node.space != "TANGENT":
            self.note(node, Fidelity.LEFT_OUT, f"a normal map in {node.space.lower()} space is left out")
            return None
        if not strength.is_constant:
            self.note(node, Fidelity.APPROXIMATED, "a strength that varies is rendered as 1")
            strength = ONE
        return Relief("normal", color, strength.number())

    def _bump(self, source: Source) -> Relief | None:
        node = source.node
        height = self.reader.at(source, "Height", 1.0)
        if height.is_constant:
            return self.relief(source)
        strength, distance = self.reader.at(source, "Strength", 1.0), self.reader.at(source, "Distance", 1.0)
        if not (strength.is_constant and distance.is_constant):
            self.note(node, Fidelity.APPROXIMATED, "strength and distance that vary are rendered as 1")
            strength = distance = ONE
        if strength.number() != 1.0:
            self.note(node, Fidelity.APPROXIMATED, "the strength of a relief multiplies its height")
        sign = -1.0 if node.invert else 1.0
        if self.relief(source) is not None:
            self.note(node, Fidelity.APPROXIMATED, "of two reliefs, one above the other, the upper one is rendered")
        return Relief("bump", scaled(height, constant(sign * strength.number() * distance.number())))


def _is_smooth(node: Any) -> bool:
    return getattr(node, "distribution", "") == "SHARP"


def _roughness(self: ShaderReader, source: Source) -> dict[str, Any]:
    """The roughness of Cycles is the square root of α."""
    roughness = constant(0.0) if _is_smooth(source.node) else self.reader.at(source, "Roughness", 0.5)
    if getattr(source.node, "distribution", "") == "MULTI_GGX" and not is_constant_of(roughness, 0.0):
        self.note(source.node, Fidelity.APPROXIMATED, "facets scatter once: rough surfaces are somewhat darker")
    distribution = "beckmann" if getattr(source.node, "distribution", "") == "BECKMANN" else "ggx"
    if getattr(source.node, "distribution", "") == "ASHIKHMIN_SHIRLEY":
        self.note(source.node, Fidelity.APPROXIMATED, "Ashikhmin-Shirley is rendered as GGX")
    return {"roughness": roughness, "roughness_scale": "square", "distribution": distribution}


def _diffuse(self: ShaderReader, source: Source) -> Shader:
    roughness = self.reader.at(source, "Roughness", 0.0)
    if not is_constant_of(roughness, 0.0):
        self.note(source.node, Fidelity.APPROXIMATED, "rough matte is Oren and Nayar's first model")
    return Shader(Model("Diffuse", {"reflectance": self.reader.color_at(source, "Color"), "roughness": roughness}))


def _glossy(self: ShaderReader, source: Source) -> Shader:
    if not is_constant_of(self.reader.at(source, "Anisotropy", 0.0), 0.0):
        self.note(source.node, Fidelity.LEFT_OUT, "anisotropy is rendered as 0")
    fields = {"reflectance": self.reader.color_at(source, "Color"), **_roughness(self, source)}
    return Shader(Model("Conductor", fields))


def _ior(self: ShaderReader, source: Source, otherwise: float) -> float:
    ior = self.reader.at(source, "IOR", otherwise)
    if not ior.is_constant:
        self.note(source.node, Fidelity.APPROXIMATED, f"an IOR that varies is rendered as {otherwise:g}")
        return otherwise
    return max(ior.number(), 1e-3)


def _glass(self: ShaderReader, source: Source) -> Shader:
    color = self.reader.color_at(source, "Color")
    fields = {"reflectance": color, "transmittance": color, "eta": _ior(self, source, 1.45), **_roughness(self, source)}
    return Shader(Model("Dielectric", fields))


def _refraction(self: ShaderReader, source: Source) -> Shader:
    self.note(source.node, Fidelity.APPROXIMATED, "refraction is rendered as glass whose reflections are black")
    color = self.reader.color_at(source, "Color")
    fields = {"reflectance": BLACK, "transmittance": color, "eta": _ior(self, source, 1.45), **_roughness(self, source)}
    return Shader(Model("Dielectric", fields))


def _translucent(self: ShaderReader, source: Source) -> Shader:
    color = self.reader.color_at(source, "Color")
    return Shader(Model("DiffuseTransmission", {"reflectance": BLACK, "transmittance": color}))


def _transparent(self: ShaderReader, source: Source) -> Shader:
    color = self.reader.color_at(source, "Color")
    return CLEAR if is_constant_of(color, 1.0) else Shader(Model("Transparent", {"color": color}))


def _emission(self: ShaderReader, source: Source) -> Shader:
    color, strength = self.reader.color_at(source, "Color"), self.reader.at(source, "Strength", 1.0)
    return Shader(emission=scaled(color, strength))


def _mix(self: ShaderReader, source: Source) -> Shader:
    inputs = [Input(socket, source.groups) for socket in source.node.inputs]
    first, second = self.shader(inputs[1]), self.shader(inputs[2])
    coated = _coated(self, inputs[0].source(), first, second)
    if coated is not None:
        return coated
    share = self.reader.number(inputs[0])
    if share.is_constant:
        share = constant(min(max(share.number(), 0.0), 1.0))
    return mixed(share, first, second)


def _coated(self: ShaderReader, share: Source | None, first: Shader, second: Shader) -> Shader | None:
    """Returns a matte surface below the reflection that a Fresnel or Layer Weight node mixes in; `None`: it is another mix."""
    eta = _fresnel_ior(self, share)
    models = first.model, second.model
    if eta is None or models[0] is None or models[1] is None or [model.name for model in models] != ["Diffuse", "Conductor"]:  # type: ignore[union-attr]
        return None
    matte, glossy = models[0].fields, models[1].fields
    is_plain = is_constant_of(matte.get("roughness", constant(0.0)), 0.0) and glossy.get("distribution") == "ggx"
    if not is_plain or not all(is_constant_of(one.opacity, 1.0) and is_constant_of(one.emission, 0.0) for one in (first, second)):
        return None
    assert share is not None
    self.note(share.node, Fidelity.APPROXIMATED, "the reflection that it mixes in is that of Principled")
    fields = {"base_color": matte["reflectance"], "roughness": glossy["roughness"], "specular_color": glossy["reflectance"], "ior": eta}
    return Shader(Model("Layered", fields), relief=first.relief or second.relief)


def _fresnel_ior(self: ShaderReader, share: Source | None) -> float | None:
    """Returns the index of refraction of a Fresnel node, or of a Layer Weight node as Fresnel; `None`: it is another node, or varies."""
    if share is None or share.node.bl_idname not in ("ShaderNodeFresnel", "ShaderNodeLayerWeight") or share.output.name == "Facing":
        return None
    if share.node.bl_idname == "ShaderNodeFresnel":
        ior = self.reader.at(share, "IOR", 1.45)
        return max(ior.number(), 1.0) if ior.is_constant else None
    blend = self.reader.at(share, "Blend", 0.5)
    return 1.0 / max(1.0 - blend.number(), 1e-2) if blend.is_constant else None


def _add(self: ShaderReader, source: Source) -> Shader:
    first, second = (self.shader(Input(socket, source.groups)) for socket in source.node.inputs)
    if first.model is not None and second.model is not None and not all(is_constant_of(one.opacity, 1.0) for one in (first, second)):
        self.note(source.node, Fidelity.APPROXIMATED, "a sum of two surfaces is opaque")
    return added(first, second)


def _holdout(self: ShaderReader, source: Source) -> Shader:
    self.note(source.node, Fidelity.LEFT_OUT, "a holdout is rendered black")
    return Shader()


def _sheen(self: ShaderReader, source: Source) -> Shader:
    self.note(source.node, Fidelity.APPROXIMATED, "sheen is that of glTF (Charlie)")
    color, roughness = self.reader.color_at(source, "Color"), self.reader.at(source, "Roughness", 0.5)
    fields = {"base_color": BLACK, "sheen_color": color, "sheen_roughness": roughness, "specular": constant(0.0), "roughness": ONE}
    return Shader(Model("Layered", fields))


def _subsurface(self: ShaderReader, source: Source) -> Shader:
    reader, node = self.reader, source.node
    is_old = not any(socket.name == "Weight" for socket in node.inputs)
    radius = scaled(reader.color_at(source, "Radius"), reader.at(source, "Scale", 1.0))
    ior, g = reader.at(source, "IOR", 1.4), reader.at(source, "Anisotropy", 0.0)
    below = subsurface_model(node, node.falloff, is_old, constant(1.0), radius, ior, g, self.note)
    fields = {"base_color": reader.color_at(source, "Color"), "specular": constant(0.0), "roughness": ONE, "subsurface": below}
    return Shader(Model("Layered", fields))


def _background(self: ShaderReader, source: Source) -> Shader:
    color, strength = self.reader.color_at(source, "Color"), self.reader.at(source, "Strength", 1.0)
    return Shader(emission=scaled(color, strength))


def _principled(self: ShaderReader, source: Source) -> Shader:
    return principled(self.reader, source, self.note)


def _hair(self: ShaderReader, source: Source) -> Shader:
    return hair_shader(self.reader, source, self.note)


_READERS: dict[str, Callable[[ShaderReader, Source], Shader]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfHairPrincipled": _hair,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfMetallic": _glossy,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _refraction,
    "ShaderNodeBsdfTranslucent": _translucent,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeBsdfSheen": _sheen,
    "ShaderNodeBsdfVelvet": _sheen,
    "ShaderNodeSubsurfaceScattering": _subsurface,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _background,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
    "ShaderNodeHoldout": _holdout,
}
