"""The scattering models of surfaces."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Sequence, Union

from ._native import MeasuredFile
from ._values import (
    Color,
    CountKind,
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
    VectorKind,
    choice,
    color,
    flag,
    number,
    of,
    plain_real,
    wrong,
)


@dataclass
class Surface(Value):
    """A scattering model. Reflectances are linear R G B from 0 to 1; every color and most numbers may be a `Texture`."""

    tag: ClassVar[str] = ""

    def plain(self, names: Names) -> Any:
        """Returns the surface as JSON."""
        return {self.tag: self.plain_fields(names)}


class SurfaceKind(Kind):
    """A surface; of the given classes, if any are given."""

    def __init__(self, *classes: type[Surface]) -> None:
        self.classes = classes or (Surface,)

    def check(self, value: Any, name: str) -> Surface:
        if isinstance(value, self.classes):
            return value
        allowed = ", ".join(cls.__name__ for cls in self.classes)
        raise wrong(name, value, f"a surface is needed ({allowed})")

    def plain(self, value: Any, names: Names) -> Any:
        return value.plain(names)

    def value(self, plain: Any, names: Names) -> Any:
        return surface_of_plain(plain, names)


class RoughnessKind(Kind):
    """Roughness, or a pair of it along u and v."""

    def check(self, value: Any, name: str) -> Any:
        kind = NumberKind(0.0, 1e15)
        if isinstance(value, (int, float, Texture)):
            return kind.check(value, name)
        try:
            along_u, along_v = value
        except (TypeError, ValueError):
            raise wrong(name, value, "a number, a Texture, or a pair of them along u and v is needed") from None
        return kind.check(along_u, f"{name}[0]"), kind.check(along_v, f"{name}[1]")

    def plain(self, value: Any, names: Names) -> Any:
        pair = value if isinstance(value, tuple) else (value, value)
        return [NumberKind().plain(member, names) for member in pair]

    def value(self, plain: Any, names: Names) -> Any:
        along_u, along_v = (NumberKind().value(member, names) for member in plain)
        return along_u if along_u == along_v else (along_u, along_v)


Roughness = Union[Number, Sequence[Number]]


@dataclass
class Faceted(Surface):
    """A surface with microfacets.

    - `roughness`: of the facets, or a pair of it along u and along v; 0: smooth.
    - `roughness_scale`: its relation to the α of the distribution: `alpha` (it is α), `square_root` (pbrt's), `square`.
    - `shadowing`: `correlated` as in pbrt, `separable` as in Mitsuba.
    """

    roughness: Roughness = of(RoughnessKind(), 0.0)
    roughness_scale: Literal["alpha", "square_root", "square"] = choice("alpha", "square_root", "square")
    distribution: Literal["ggx", "beckmann"] = choice("ggx", "beckmann")
    shadowing: Literal["correlated", "separable"] = choice("correlated", "separable")

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        members = {"roughness": "roughness", "scale": "roughness_scale", "distribution": "distribution"}
        members["shadowing"] = "shadowing"
        plain["facets"] = {name: plain.pop(member) for name, member in members.items()}
        return plain

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Any:
        facets = dict(plain["facets"])
        facets["roughness_scale"] = facets.pop("scale")
        return super().of_plain({**plain, **facets}, names)


@dataclass
class Null(Surface):
    """No surface: only the boundary of two media."""

    tag = "null"

    def plain(self, names: Names) -> Any:
        return "null"


@dataclass
class Unlit(Surface):
    """Emits its color, at most 1, and scatters nothing."""

    tag = "unlit"
    color: Color = of(TexturedColorKind(), 1.0)

    def plain(self, names: Names) -> Any:
        return {"unlit": self.plain_fields(names)["color"]}


@dataclass
class Diffuse(Surface):
    """A matte surface: Lambertian, or Oren and Nayar's. `roughness`: deviation of its slopes, in radians."""

    tag = "diffuse"
    reflectance: Color = color(0.8)
    roughness: Number = number(0.0)


@dataclass
class DiffuseTransmission(Surface):
    """Diffuse reflection and transmission, as of paper or a leaf."""

    tag = "diffuse_transmission"
    reflectance: Color = color(0.25)
    transmittance: Color = color(0.25)


@dataclass
class Conductor(Faceted):
    """Metal, by its complex index of refraction `eta` + i `k`, R G B; both 0: a perfect mirror."""

    tag = "conductor"
    eta: Color = color(0.0)
    k: Color = color(0.0)
    reflectance: Color = color(1.0)


@dataclass
class Dielectric(Faceted):
    """The boundary of a clear solid. `eta`: index of refraction behind the front over that before it. `thin`: a sheet."""

    tag = "dielectric"
    eta: float = plain_real(1.5)
    reflectance: Color = color(1.0)
    transmittance: Color = color(1.0)
    thin: bool = flag(False)


@dataclass
class Plastic(Faceted):
    """A diffuse base below a dielectric boundary, as in Mitsuba. `inner`: light that the boundary reflects back inside."""

    tag = "plastic"
    eta: float = plain_real(1.49)
    diffuse: Color = color(0.5)
    specular: Color = color(1.0)
    inner: Literal["linear", "nonlinear", "lost"] = choice("linear", "nonlinear", "lost")


@dataclass
class Coated(Faceted):
    """A `Diffuse` or `Conductor` base below a layer that may absorb and scatter, as in pbrt. The roughness is the layer's.

    `thickness` is in mean free paths, `albedo` and `g` are those within the layer, `max_depth` the most scattering events.
    """

    tag = "coated"
    eta: float = plain_real(1.5)
    thickness: Number = number(0.01)
    albedo: Color = color(0.0)
    g: Number = number(0.0)
    max_depth: int = of(CountKind(), 10)
    base: Diffuse | Conductor = of(SurfaceKind(Diffuse, Conductor), Diffuse())


@dataclass
class Varnished(Faceted):
    """A base below a clear layer whose boundary has the roughness. Light reflected back inside is lost, as in Mitsuba 0.6's `coating`.

    `absorption` is the optical thickness of the layer, R G B. The base is a `Diffuse`, `Conductor`, `Plastic`, `Phong`, `Ward`, or a `Principled` that transmits nothing.
    """

    tag = "varnished"
    eta: float = plain_real(1.5)
    specular: Color = color(1.0)
    absorption: Color = color(0.0)
    base: Surface = of(SurfaceKind(), Diffuse())


@dataclass
class Phong(Surface):
    """A diffuse surface with Phong's highlights. `diffuse` and `specular` together are at most 1; `exponent`: 0 broad, 1000 sharp."""

    tag = "phong"
    diffuse: Color = color(0.5)
    specular: Color = color(0.2)
    exponent: Number = number(30.0)


@dataclass
class Ward(Surface):
    """A diffuse surface with Ward's highlights. `roughness`: α, or a pair of it along u and v. `variant`: the normalization."""

    tag = "ward"
    diffuse: Color = color(0.5)
    specular: Color = color(0.2)
    roughness: Roughness = of(RoughnessKind(), 0.1)
    variant: Literal["balanced", "ward", "duer"] = choice("balanced", "ward", "duer")


class MeasuredFileKind(Kind):
    """The tables of a measured material, or the path of its file, which is read at once."""

    def check(self, value: Any, name: str) -> Any:
        if isinstance(value, (str, os.PathLike)):
            return MeasuredFile(value)
        if isinstance(value, MeasuredFile):
            return value
        raise wrong(name, value, "the path of a .bsdf file or a MeasuredFile is needed")


@dataclass
class Measured(Surface):
    """A measured reflectance: a `.bsdf` file of pbrt's and Mitsuba's `measured`, by its path or as a `MeasuredFile`, which surfaces share."""

    tag = "measured"
    file: MeasuredFile | str | os.PathLike[str] = of(MeasuredFileKind(), ...)

    def plain(self, names: Names) -> Any:
        return json.loads(self.__dict__["file"].json())

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Any:
        return cls(MeasuredFile.of_json(json.dumps({cls.tag: plain})))


@dataclass
class Principled(Surface):
    """Disney's material (Burley 2012 and 2015). `roughness` is perceptual: α is its square."""

    tag = "principled"
    base_color: Color = color(0.8)
    roughness: Number = number(0.5)
    anisotropic: Number = number(0.0)
    metallic: Number = number(0.0)
    spec_trans: Number = number(0.0)
    eta: float = plain_real(1.5)
    spec_tint: Number = number(0.0)
    sheen: Number = number(0.0)
    sheen_tint: Number = number(0.0)
    flatness: Number = number(0.0)
    clearcoat: Number = number(0.0)
    clearcoat_gloss: Number = number(0.0)
    diff_trans: Number = number(0.0)
    thin: bool = flag(False)


class MaybeColorKind(TexturedColorKind):
    """A color, or `None`."""

    def check(self, value: Any, name: str) -> Any:
        return None if value is None else super().check(value, name)

    def plain(self, value: Any, names: Names) -> Any:
        return None if value is None else super().plain(value, names)


@dataclass
class Hair(Surface):
    """Hair or fur (Chiang et al. 2016). What its fibres absorb is the first that is given of `sigma_a`, `reflectance` and pigments.

    - `eumelanin`, `pheomelanin`: concentrations of the brown and the red pigment; about 0.3 for blond, 1.3 for brown, 8 for black hair.
    - `reflectance`: of many fibres. `sigma_a`: absorption coefficient within a fibre, per radius.
    - `eta`: index of refraction. `beta_m`, `beta_n`: longitudinal and azimuthal roughness, from 0 to 1.
    - `alpha`: angle of the scales, in degrees.
    - `strand`: `along_u`: a fibre runs along u, and v goes from 0 to 1 across its width; `along_v`: it runs along v, and the mesh is round.
    """

    tag = "hair"
    eumelanin: Number = number(1.3)
    pheomelanin: Number = number(0.0)
    reflectance: Color | None = of(MaybeColorKind(), None)
    sigma_a: Color | None = of(MaybeColorKind(), None)
    eta: float = plain_real(1.55)
    beta_m: Number = number(0.3, 0.0, 1.0)
    beta_n: Number = number(0.3, 0.0, 1.0)
    alpha: float = plain_real(2.0, -90.0, 90.0)
    strand: Literal["along_u", "along_v"] = choice("along_u", "along_v")

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        melanin = {name: plain.pop(name) for name in ("eumelanin", "pheomelanin")}
        reflectance, sigma_a = plain.pop("reflectance"), plain.pop("sigma_a")
        if sigma_a is not None:
            return {**plain, "pigment": {"sigma_a": sigma_a}}
        if reflectance is not None:
            return {**plain, "pigment": {"reflectance": reflectance}}
        return {**plain, "pigment": {"melanin": melanin}}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Any:
        ((tag, pigment),) = plain["pigment"].items()
        colors: dict[str, Any] = {name: MaybeColorKind().value(pigment, names) if tag == name else None for name in ("reflectance", "sigma_a")}
        number_of = NumberKind().value
        melanin = {name: number_of(value, names) for name, value in pigment.items()} if tag == "melanin" else {}
        same = {name: plain[name] for name in ("eta", "alpha", "strand")}
        return cls(**melanin, **colors, **same, beta_m=number_of(plain["beta_m"], names), beta_n=number_of(plain["beta_n"], names))


@dataclass
class Anisotropy(Value):
    """The direction of highlights. `rotation`: from the tangent, in radians. `texture`: R G the direction, B the strength."""

    strength: float = plain_real(0.0, 0.0, 1.0)
    rotation: float = plain_real(0.0, -1e15)
    texture: Texture | None = of(TextureKind(), None)


@dataclass
class Iridescence(Value):
    """A thin film. `thickness`: in nanometres, where its texture is 0 and where it is 1 or missing."""

    factor: Number = number(1.0)
    ior: float = plain_real(1.3)
    thickness: Sequence[float] = of(VectorKind(2, 0.0, 1e15), (100.0, 400.0))
    thickness_texture: Texture | None = of(TextureKind(True), None)


@dataclass
class Subsurface(Value):
    """Scattering below a surface, as of skin, wax, milk or marble. The mesh must be closed.

    - `weight`: share of the diffuse light that enters; the rest is reflected where it arrives.
    - `radius`: how far light travels inside, R G B in scene units. A thick slab then reflects the base color.
    - `radius_ior`: `None`: `radius` is the mean free path; a number: it is the diffuse mean free path of a dipole with this index of refraction.
    - `absorption`, `scattering`: coefficients R G B per scene unit, instead of `radius` and the base color.
    - `g`: asymmetry of scattering, between -1 and 1; above 0: forward.
    - `inner_eta`: index of refraction that decides how much light the surface reflects back inside; 1: none.
    """

    weight: Number = number(1.0, 0.0, 1.0)
    radius: Color = color((1.0, 0.2, 0.1))
    radius_ior: float | None = of(MaybeRealKind(), None)
    absorption: Color | None = of(MaybeColorKind(), None)
    scattering: Color | None = of(MaybeColorKind(), None)
    g: float = plain_real(0.0, -0.9999, 0.9999)
    inner_eta: float = plain_real(1.0, 1.0, 1e3)

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        radius, ior = plain.pop("radius"), plain.pop("radius_ior")
        absorption, scattering = plain.pop("absorption"), plain.pop("scattering")
        if (absorption is None) != (scattering is None):
            raise ValueError("a Subsurface has `absorption` and `scattering` together, or neither")
        if scattering is not None:
            return {**plain, "substance": {"coefficients": {"absorption": absorption, "scattering": scattering}}}
        meaning = "mean_free_path" if ior is None else {"diffuse_mean_free_path": ior}
        return {**plain, "substance": {"colored": {"radius": radius, "meaning": meaning}}}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Any:
        ((tag, substance),) = plain["substance"].items()
        values: dict[str, Any] = {"weight": NumberKind().value(plain["weight"], names), "g": plain["g"], "inner_eta": plain["inner_eta"]}
        if tag == "coefficients":
            values |= {name: MaybeColorKind().value(substance[name], names) for name in ("absorption", "scattering")}
        else:
            meaning = substance["meaning"]
            values["radius"] = TexturedColorKind().value(substance["radius"], names)
            values["radius_ior"] = meaning["diffuse_mean_free_path"] if isinstance(meaning, dict) else None
        return cls(**values)


class ScaledMapKind(TextureKind):
    """A normal map, whose factor scales x and y; or `None`."""

    def plain(self, value: Any, names: Names) -> Any:
        return None if value is None else [value.map(names), _scale(value)]

    def value(self, plain: Any, names: Names) -> Any:
        return None if plain is None else Texture.of_map(plain[0], names, plain[1])


def _scale(texture: Texture) -> float:
    factor = texture.factor
    return float(factor) if isinstance(factor, (int, float)) else float(factor[0])


@dataclass
class Layered(Surface):
    """glTF's layered material: plastic by default, metal with `metallic=1`, glass with `transmission=1`, lacquer with `coat=1`.

    Roughness is perceptual: 0 a mirror, 1 matte. `thin`: a sheet without volume; otherwise the mesh bounds a solid.
    `subsurface` scatters diffuse light below the surface of a solid that transmits no other light. `dispersion` is 20 over the Abbe number. `coat_normal` is a normal map of the coat, with its scale as factor.
    """

    tag = "layered"
    base_color: Color = color(0.8)
    metallic: Number = number(0.0, 0.0, 1.0)
    roughness: Number = number(0.5, 0.0, 1.0)
    anisotropy: Anisotropy | None = of(ValueKind(Anisotropy), None)
    ior: float = plain_real(1.5)
    dispersion: float = plain_real(0.0)
    specular: Number = number(1.0, 0.0, 1.0)
    specular_color: Color = color(1.0)
    transmission: Number = number(0.0, 0.0, 1.0)
    diffuse_transmission: Number = number(0.0, 0.0, 1.0)
    diffuse_transmission_color: Color = color(1.0)
    subsurface: Subsurface | None = of(ValueKind(Subsurface), None)
    thin: bool = flag(False)
    iridescence: Iridescence | None = of(ValueKind(Iridescence), None)
    coat: Number = number(0.0, 0.0, 1.0)
    coat_roughness: Number = number(0.0, 0.0, 1.0)
    coat_normal: Texture | None = of(ScaledMapKind(), None)
    sheen_color: Color = color(0.0)
    sheen_roughness: Number = number(0.0, 0.0, 1.0)


@dataclass
class Blend(Surface):
    """A mix of two surfaces. `weight`: share of the second."""

    tag = "blend"
    weight: Number = number(0.5, 0.0, 1.0)
    first: Surface = of(SurfaceKind(), Diffuse())
    second: Surface = of(SurfaceKind(), Diffuse())

    def plain(self, names: Names) -> Any:
        plain = self.plain_fields(names)
        return {"blend": {"weight": plain["weight"], "surfaces": [plain["first"], plain["second"]]}}


@dataclass
class Sum(Surface):
    """The sum of what two surfaces scatter, which may be more than arrives."""

    tag = "sum"
    first: Surface = of(SurfaceKind(), Diffuse())
    second: Surface = of(SurfaceKind(), Diffuse())

    def plain(self, names: Names) -> Any:
        plain = self.plain_fields(names)
        return {"sum": [plain["first"], plain["second"]]}


@dataclass
class Transparent(Surface):
    """Lets light pass straight through, in a color, without counting a bounce. What is behind it is lit in that color."""

    tag = "transparent"
    color: Color = color(1.0)

    def plain(self, names: Names) -> Any:
        sheet = Dielectric(eta=1.0, transmittance=self.color, thin=True)
        return sheet.plain(names)


def is_transparent(surface: Surface) -> bool:
    """Returns true if a surface is, or has in it, a `Transparent` one."""
    if isinstance(surface, (Blend, Sum)):
        return is_transparent(surface.first) or is_transparent(surface.second)
    return isinstance(surface, Transparent)


_CLASSES: tuple[type[Surface], ...] = (
    Diffuse,
    DiffuseTransmission,
    Conductor,
    Dielectric,
    Plastic,
    Coated,
    Varnished,
    Phong,
    Ward,
    Measured,
    Principled,
    Layered,
    Hair,
)


def surface_of_plain(plain: Any, names: Names) -> Surface:
    """Makes a surface from JSON."""
    if plain == "null":
        return Null()
    ((tag, members),) = plain.items()
    if tag == "unlit":
        return Unlit.of_plain({"color": members}, names)
    if tag == "sum":
        return Sum.of_plain({"first": members[0], "second": members[1]}, names)
    if tag == "transparent":
        return Transparent.of_plain({"color": members}, names)
    if tag == "blend":
        first, second = members["surfaces"]
        return Blend.of_plain({"weight": members["weight"], "first": first, "second": second}, names)
    return next(cls for cls in _CLASSES if cls.tag == tag).of_plain(members, names)


def with_transparency(plain: Any) -> Any:
    """Returns the JSON of a surface with its clear sheets as `transparent`."""
    if not isinstance(plain, dict):
        return plain
    ((tag, it),) = plain.items()
    if tag == "sum":
        return {"sum": [with_transparency(part) for part in it]}
    if tag == "blend":
        return {"blend": {**it, "surfaces": [with_transparency(part) for part in it["surfaces"]]}}
    if tag == "dielectric" and it["thin"] and it["eta"] == 1.0:
        if all(roughness["factor"] == 0.0 for roughness in it["facets"]["roughness"]):
            return {"transparent": it["transmittance"]}
    return plain
