"""Materials and media of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Sequence, Union

from ._surfaces import Diffuse, Surface, SurfaceKind, is_transparent, with_transparency
from ._values import (
    Color,
    ColorKind,
    KeyKind,
    Kind,
    MaybeRealKind,
    Names,
    Number,
    NumberKind,
    Texture,
    TexturedColorKind,
    TextureKind,
    Value,
    ValueKind,
    choice,
    color,
    flag,
    number,
    of,
    plain_real,
    wrong,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._native import Voxels

Sides = Literal["front", "back", "both"]


class ReliefRuleKind(Kind):
    """`bent`, or the rules of Mitsuba 3: a dictionary of `turns`, `shadows` and `mirrored`."""

    def check(self, value: Any, name: str) -> Any:
        if value == "bent" or (isinstance(value, dict) and set(value) == {"mitsuba"}):
            return value
        raise wrong(name, value, "'bent' or {'mitsuba': {'turns', 'shadows', 'mirrored'}} is needed")


@dataclass
class NormalMap(Value):
    """A normal map in tangent space. `scale` multiplies its x and y. Use an image of `color_space="data"`."""

    texture: Texture = of(Kind(), ...)
    scale: float = plain_real(1.0, -1e15)
    rule: Any = of(ReliefRuleKind(), "bent")


@dataclass
class BumpMap(Value):
    """Heights above the surface, in scene units: a `Texture` whose factor is the height of 1."""

    height: Number = of(NumberKind(-1e15, 1e15), ...)
    rule: Any = of(ReliefRuleKind(), "bent")


Relief = Union[NormalMap, BumpMap]


class ReliefKind(Kind):
    """A relief, or `None`."""

    def check(self, value: Any, name: str) -> Any:
        if value is None or isinstance(value, (NormalMap, BumpMap)):
            return value
        raise wrong(name, value, "a NormalMap, a BumpMap or None is needed")

    def plain(self, value: Any, names: Names) -> Any:
        if value is None:
            return None
        if isinstance(value, NormalMap):
            return {"source": {"normals": [value.texture.map(names), value.scale]}, "rule": value.rule}
        return {"source": {"heights": NumberKind().plain(value.height, names)}, "rule": value.rule}

    def value(self, plain: Any, names: Names) -> Any:
        if plain is None:
            return None
        ((kind, members),) = plain["source"].items()
        if kind == "normals":
            return NormalMap(Texture.of_map(members[0], names), members[1], plain["rule"])
        return BumpMap(NumberKind().value(members, names), plain["rule"])


class BackKind(SurfaceKind):
    """`same`, `black`, or another surface."""

    def check(self, value: Any, name: str) -> Any:
        return value if value in ("same", "black") else super().check(value, name)

    def plain(self, value: Any, names: Names) -> Any:
        return value if isinstance(value, str) else {"other": super().plain(value, names)}

    def value(self, plain: Any, names: Names) -> Any:
        return plain if isinstance(plain, str) else super().value(plain["other"], names)


@dataclass
class Displacement(Value):
    """Moves the points of meshes by a `Texture`; they are refined first. `scale` times the texture, plus `bias`, is a length.

    - `vectors`: `none`: heights along the normal; `tangent`: red along the tangent, green along the normal, blue along the bitangent; `object`.
    - `space`: `object`: larger objects are displaced more; `world`: lengths are scene units.
    - `edge`: the longest edge after refinement; `None`: a texel. `keeps_normals`: a relief has the slopes of the texture.
    """

    texture: Texture = of(TextureKind(), ...)
    scale: float = plain_real(1.0, -1e15)
    bias: float = plain_real(0.0, -1e15)
    vectors: Literal["none", "tangent", "object"] = choice("none", "tangent", "object")
    space: Literal["object", "world"] = choice("object", "world")
    edge: float | None = of(MaybeRealKind(), None)
    keeps_normals: bool = flag(False)

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = {"scale": self.scale, "bias": self.bias, "space": self.space, "edge": self.edge, "keeps_normals": self.keeps_normals}
        if self.vectors == "none":
            return {**plain, "source": {"heights": NumberKind().plain(self.texture, names)}}
        return {**plain, "source": {f"{self.vectors}_vectors": TexturedColorKind().plain(self.texture, names)}}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Displacement:
        ((kind, members),) = plain["source"].items()
        same: dict[str, Any] = {name: plain.get(name) for name in ("scale", "bias", "space", "edge", "keeps_normals")}
        if kind == "heights":
            return cls(NumberKind().value(members, names), **same)
        same["vectors"] = kind.removesuffix("_vectors")
        return cls(TexturedColorKind().value(members, names), **same)


@dataclass
class Material(Value):
    """The properties of a surface at each of its points. The fields of its `surface` are fields of the material as well:
    `material.roughness = 0.2`.

    - `back`: the scattering of the back: `same`, `black`, or another surface.
    - `opacity`: from 0 to 1; it counts unless `alpha` is `opaque`. `alpha`: `mask` is there from `alpha_cutoff` on, `blend` by
      chance, `absent` never.
    - `culls_back`: the camera sees through it from behind.
    - `emission`: radiance R G B in W·sr⁻¹·m⁻², from `emission_sides`. `emission_spread`: full angle in degrees of the cone around the
      normal into which it emits, from 0.2 to 180 (all directions); the power stays.
    - `relief`: a `NormalMap`, a `BumpMap`, or `None`. `displacement`: a `Displacement`, or `None`.
    - `interior`, `exterior`: keys of the media behind and before the front; `None`: vacuum.
    - `see_through`: light that passes straight through a smooth thin sheet counts no bounce; always so with `Transparent`.
    """

    surface: Surface = of(SurfaceKind(), Diffuse())
    back: Surface | Literal["same", "black"] = of(BackKind(), "same")
    opacity: Number = number(1.0, 0.0, 1.0)
    alpha: Literal["opaque", "mask", "blend", "absent"] = choice("opaque", "mask", "blend", "absent")
    alpha_cutoff: float = plain_real(0.5)
    culls_back: bool = flag(False)
    emission: Color = color(0.0)
    emission_sides: Sides = choice("both", "front", "back")
    emission_spread: float = plain_real(180.0, 0.2, 180.0)
    relief: Relief | None = of(ReliefKind(), None)
    displacement: Displacement | None = of(ValueKind(Displacement), None)
    interior: str | None = of(KeyKind("medium"), None)
    exterior: str | None = of(KeyKind("medium"), None)
    see_through: bool = flag(False)

    if not TYPE_CHECKING:

        def __setattr__(self, name: str, value: Any) -> None:
            surface = self.__dict__.get("surface")
            if name not in _OWN and surface is not None and hasattr(surface, name):
                setattr(surface, name, value)
            else:
                super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        surface = self.__dict__.get("surface")
        if surface is None or name.startswith("_") or not hasattr(surface, name):
            kind = type(surface).__name__
            raise AttributeError(f"a material of a {kind} surface has no field `{name}`")
        return getattr(surface, name)

    @classmethod
    def matte(cls, color: Color = 0.8) -> Material:
        """Makes a matte surface, such as chalk (Lambert)."""
        return cls(Diffuse(color))

    @classmethod
    def emitter(cls, radiance: Color) -> Material:
        """Makes a black surface that emits the same radiance in all directions from its front."""
        return cls(Diffuse(0.0), emission=radiance, emission_sides="front")

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        alpha, cutoff = plain.pop("alpha"), plain.pop("alpha_cutoff")
        plain["alpha_mode"] = {"mask": {"cutoff": cutoff}} if alpha == "mask" else alpha
        half_angle = math.radians(0.5 * plain.pop("emission_spread"))
        plain["emission_profile"] = {"spread": {"half_angle": half_angle}} if self.emission_spread < 180.0 else "diffuse"
        sides = [self.surface, *([] if isinstance(self.back, str) else [self.back])]
        plain["see_through"] = self.see_through or any(map(is_transparent, sides))
        return {"name": "", **plain}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Material:
        alpha = plain["alpha_mode"]
        mask = alpha["mask"] if isinstance(alpha, dict) else None
        profile = plain["emission_profile"]
        spread = 2.0 * math.degrees(profile["spread"]["half_angle"]) if "spread" in profile else 180.0
        members = {"alpha": alpha if mask is None else "mask", "alpha_cutoff": mask["cutoff"] if mask else 0.5}
        members["emission_spread"] = min(spread, 180.0)
        members["displacement"] = plain.get("displacement")
        if plain["see_through"]:
            members["surface"] = with_transparency(plain["surface"])
            if isinstance(plain["back"], dict):
                members["back"] = {"other": with_transparency(plain["back"]["other"])}
        return super().of_plain({**plain, **members}, names)


_OWN = frozenset(Material.__dataclass_fields__)


class ArrayKind(Kind):
    """An array; it is checked when it is put into a scene."""


@dataclass
class Medium(Value):
    """A participating medium with Henyey-Greenstein scattering. Coefficients are R G B per scene unit.

    - `g`: mean cosine of the scattering angle, between -1 and 1.
    - `density`: float32, (depth, height, width), or with 3 for colors: multiplies absorption and scattering; `None`: the same
      everywhere. `albedo`: the same shape; `density` then multiplies their sum. `emission_grid`: multiplies the emission.
    - `transform`: (4, 4), from the unit cube of the grids to the world: x along the width, y the height, z the depth. Outside, the
      medium is empty.
    - `voxels`: density and temperatures of an OpenVDB or NanoVDB file, in place of `density`; `transform` then leads from the space
      of the file to the world. Temperatures are (values - `temperature_offset`) * `temperature_scale`, in kelvin.
    - `blackbody`: radiance of a temperature, a factor of `emission`. `'peaks'`: its spectrum has its peak at 1, and it is proportional
      to the density, as in pbrt. `'power'`: 1e-6 times the law of Stefan and Boltzmann per scene unit, as in Cycles.

    The grids of a medium that was taken out of a scene are `None`; they stay when other fields change.
    """

    absorption: Color = of(ColorKind(), 0.0)
    scattering: Color = of(ColorKind(), 0.0)
    emission: Color = of(ColorKind(), 0.0)
    g: float = plain_real(0.0, -0.9999, 0.9999)
    density: NDArray[np.float32] | None = of(ArrayKind(), None)
    albedo: NDArray[np.float32] | None = of(ArrayKind(), None)
    emission_grid: NDArray[np.float32] | None = of(ArrayKind(), None)
    transform: ArrayLike | Sequence[Sequence[float]] | None = of(ArrayKind(), None)
    voxels: Voxels | None = of(ArrayKind(), None)
    temperature_scale: float = plain_real(1.0)
    temperature_offset: float = plain_real(0.0, -1e9)
    blackbody: Literal["peaks", "power"] = choice("peaks", "power")

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in ("absorption", "scattering", "emission", "g")}
        return {"name": "", **plain}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Medium:
        return cls(plain["absorption"], plain["scattering"], plain["emission"], plain["g"])
