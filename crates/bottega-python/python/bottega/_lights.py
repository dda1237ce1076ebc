"""Lights, environments, cameras and spheres of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Sequence

from ._errors import SceneError
from ._values import (
    IDENTITY3,
    IDENTITY4,
    ChoiceKind,
    Color,
    ColorKind,
    CountKind,
    DirectionKind,
    KeyKind,
    Kind,
    MatrixKind,
    MaybeChoiceKind,
    MaybeRealKind,
    Names,
    Texture,
    TextureKind,
    Value,
    ValueKind,
    VectorKind,
    Visibility,
    VisibilityKind,
    choice,
    flag,
    of,
    plain_real,
    real,
    reals,
    rows,
)

Vector = Sequence[float]
Matrix = Sequence[Sequence[float]]


@dataclass
class Light(Value):
    """A light. Meshes that emit are objects whose material has `emission`. `visibility`: the kinds of ray that it reaches."""

    tag: ClassVar[str] = ""

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        visibility = plain.pop("visibility")
        tag, members = self.plain_kind(plain)
        return {"kind": {tag: members}, "visibility": visibility}

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        return self.tag, plain


@dataclass
class PointLight(Light):
    """A point or a sphere that emits equally in all directions. `intensity`: R G B in W·sr⁻¹, from afar.

    `radius`: of the sphere, in scene units; 0: a point, with sharp shadows. A sphere is seen by the camera and in mirrors, and casts no
    shadow.
    """

    tag = "point"
    position: Vector = of(VectorKind(), (0.0, 0.0, 0.0))
    intensity: Color = of(ColorKind(), 1.0)
    radius: float = plain_real(0.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        if plain["radius"] > 0.0:
            return "sphere", {**plain, "spot": None}
        del plain["radius"]
        return self.tag, plain


@dataclass
class SunLight(Light):
    """Light from infinitely far away, like the sun's.

    `direction`: in which it travels. `irradiance`: R G B on a perpendicular surface, in W·m⁻², whatever the angle.
    `angle`: diameter of its disc in degrees, from 0 (parallel light, sharp shadows) to 180; the sun's is 0.53.
    """

    tag = "directional"
    direction: Vector = of(DirectionKind(), (0.0, -1.0, 0.0))
    irradiance: Color = of(ColorKind(), 1.0)
    angle: float = plain_real(0.0, 0.0, 180.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())

    @classmethod
    def by_matrix(cls, matrix: Matrix, irradiance: Color = 1.0, angle: float = 0.0) -> SunLight:
        """Makes a light that travels along the -z axis of a matrix, (4, 4), from light space to world space."""
        _, direction = _place(matrix)
        return cls(direction, irradiance, angle)

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        return self.tag, {**plain, "angle": math.radians(plain["angle"])}


@dataclass
class SpotLight(Light):
    """A point or a sphere that emits into a cone. `intensity`: R G B on the axis, in W·sr⁻¹, from afar.

    - `inner` and `outer`: half angles in degrees, up to which the intensity is full, and from which it is 0.
    - `falloff` between them, where x is 1 at the inner angle and 0 at the outer one: `squared_cosine` (glTF) is x² of the cosine,
      `smooth_cosine` (pbrt and Blender) 3x² - 2x³ of the cosine, `linear_angle` (Mitsuba) x of the angle.
    - `radius`: of the sphere, in scene units; 0: a point. Each point of it falls off by the direction of its light, so that shadows and the
      cone's edge are soft.
    """

    tag = "spot"
    position: Vector = of(VectorKind(), (0.0, 0.0, 0.0))
    direction: Vector = of(DirectionKind(), (0.0, -1.0, 0.0))
    intensity: Color = of(ColorKind(), 1.0)
    inner: float = plain_real(0.0, 0.0, 180.0)
    outer: float = plain_real(45.0, 0.0, 180.0)
    falloff: Literal["squared_cosine", "linear_angle", "smooth_cosine"] = choice(
        "squared_cosine", "linear_angle", "smooth_cosine"
    )
    radius: float = plain_real(0.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())

    @classmethod
    def blended(cls, matrix: Matrix, size: float, blend: float, **fields: Any) -> SpotLight:
        """Makes a light as Blender describes it. `size`: full angle of the cone, in degrees. `blend`: from 0 (a hard edge) to 1 (the
        falloff begins at the axis). See `by_matrix` for the rest."""
        outer = 0.5 * real(size, "size", 1e-3, 360.0)
        cosine = math.cos(math.radians(outer))
        inner = math.acos(min(1.0, cosine + (1.0 - cosine) * max(real(blend, "blend", 0.0, 1.0), 1e-3)))
        return cls.by_matrix(matrix, inner=math.degrees(inner), outer=outer, falloff="smooth_cosine", **fields)

    @classmethod
    def by_matrix(cls, matrix: Matrix, **fields: Any) -> SpotLight:
        """Makes a light at the origin of a matrix, (4, 4), from light space to world space, that shines along its -z axis."""
        position, direction = _place(matrix)
        return cls(position, direction, **fields)

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        inner, outer, radius = plain.pop("inner"), plain.pop("outer"), plain.pop("radius")
        if inner >= outer:
            raise SceneError(f"`inner` is {inner} and `outer` {outer}: `inner` must be the smaller angle")
        cosines = {"cos_inner": math.cos(math.radians(inner)), "cos_outer": math.cos(math.radians(outer))}
        if radius == 0.0:
            return self.tag, {**plain, **cosines}
        spot = {**cosines, "direction": plain.pop("direction"), "falloff": plain.pop("falloff")}
        return "sphere", {**plain, "radius": radius, "spot": spot}


@dataclass
class AreaLight(Light):
    """A flat light around the origin of `transform`, (4, 4), from light space to world space, that emits towards its -z axis.

    - `size`: extents along x and y of light space; `transform` may scale them. `shape`: `rectangle` or `ellipse`.
    - `power`: R G B in W, whatever size and spread. A light that emits into all directions has the radiance power / (π area).
    - `spread`: full angle in degrees of the cone around -z into which each point emits, from 0.2 to 180 (all directions). The radiance
      falls off as behind a grid: at an angle θ it is proportional to tan(spread / 2) - tan θ.
    - `texture`: multiplies the radiance; the upper left corner of its image lies at -x, +y of light space. `None`: it is even.
    - `profile`: key of an image, as of a `GoniometricLight` with `latitude_longitude_to_poles`, that multiplies the radiance by direction;
      `profile_rotation`: (3, 3), from its space to world space. A light with a profile has no spread.

    The camera and mirrors see it from the front. It casts no shadow.
    """

    tag = "area"
    transform: Matrix = of(MatrixKind(), IDENTITY4)
    size: Vector = of(VectorKind(2, 0.0, 1e15), (1.0, 1.0))
    power: Color = of(ColorKind(), 1.0)
    shape: Literal["rectangle", "ellipse"] = choice("rectangle", "ellipse")
    spread: float = plain_real(180.0, 0.2, 180.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())
    texture: Texture | None = of(TextureKind(), None)
    profile: str | None = of(KeyKind("image"), None)
    profile_rotation: Matrix = of(MatrixKind(3, 3), IDENTITY3)

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        rotation = plain.pop("profile_rotation")
        if plain["profile"] is not None:
            plain["profile"] = {"image": plain["profile"], "world_from_light": rotation}
        spread, shape = plain.pop("spread"), plain.pop("shape")
        # 180° is a little more than π in single precision, and means no spread at all
        more = {"is_ellipse": shape == "ellipse", "spread": math.radians(spread) if spread < 180.0 else 4.0}
        return self.tag, {"world_from_light": plain.pop("transform"), **plain, **more}


@dataclass
class ProjectorLight(Light):
    """A point that projects an image along the -z axis of `transform`, (4, 4), from light space to world space, without scale.

    `intensity`: multiplies the image: R G B on the axis, in W·sr⁻¹. `fov`: full vertical angle, in degrees. `aspect`: width over
    height.
    """

    tag = "projector"
    picture: Texture = of(TextureKind(), ...)
    transform: Matrix = of(MatrixKind(), IDENTITY4)
    intensity: Color = of(ColorKind(), 1.0)
    fov: float = plain_real(40.0, 0.001, 179.999)
    aspect: float = plain_real(1.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        fov = math.radians(plain.pop("fov"))
        return self.tag, {"world_from_light": plain.pop("transform"), "vertical_fov": fov, **plain}


@dataclass
class GoniometricLight(Light):
    """A point or a sphere whose intensity an image gives for each direction: a profile of IES, or pbrt's `goniometric`.

    - `image`: key of the image.
    - `intensity`: R G B in W·sr⁻¹ where the image has 1.
    - `rotation`: (3, 3), from light to world space; may mirror.
    - `mapping`: `equal_area` (pbrt's: the mean of the channels of the nearest texel), or `latitude_longitude_to_poles`: the upper row is
      +y of light space, the lower row -y, the left edge +z, and columns grow towards -x.
    - `radius`: of the sphere, in scene units; 0: a point, with sharp shadows. A sphere needs `latitude_longitude_to_poles`.
    """

    tag = "goniometric"
    image: str = of(KeyKind("image", False), ...)
    position: Vector = of(VectorKind(), (0.0, 0.0, 0.0))
    rotation: Matrix = of(MatrixKind(3, 3), IDENTITY3)
    intensity: Color = of(ColorKind(), 1.0)
    visibility: Visibility = of(VisibilityKind(), Visibility())
    mapping: Literal["equal_area", "latitude_longitude_to_poles"] = choice("equal_area", "latitude_longitude_to_poles")
    radius: float = plain_real(0.0)

    @classmethod
    def along(cls, image: str, matrix: Matrix, **fields: Any) -> GoniometricLight:
        """Makes a lamp at the origin of a matrix, (4, 4), from light space to world space, from `IesProfile.pixels`. Straight down of the
        profile is the -z axis; horizontal angles grow from +x to +y."""
        by_rows = rows(matrix, "matrix", 4, 4)
        position = tuple(row[3] for row in by_rows[:3])
        rotation = tuple((-row[1], -row[2], row[0]) for row in by_rows[:3])
        return cls(image, position, rotation, mapping="latitude_longitude_to_poles", **fields)

    def plain_kind(self, plain: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        plain["world_from_light"], radius = plain.pop("rotation"), plain.pop("radius")
        if radius == 0.0:
            return self.tag, plain
        if plain.pop("mapping") != "latitude_longitude_to_poles":
            raise SceneError("`radius` is above 0: `mapping` must be 'latitude_longitude_to_poles'")
        profile = {"image": plain.pop("image"), "world_from_light": plain.pop("world_from_light")}
        return "sphere", {**plain, "radius": radius, "spot": None, "profile": profile}


def light_of_plain(plain: dict[str, Any], names: Names) -> Light:
    """Makes a light from JSON."""
    ((tag, it),) = plain["kind"].items()
    visibility = Visibility.of_bits(plain["visibility"])
    if tag == "goniometric" or (tag == "sphere" and it.get("profile") is not None):
        profile = it.get("profile") or it
        image = names.key_of("image", profile["image"]) or ""
        rotation = MatrixKind(3, 3).value(profile["world_from_light"], names)
        mapping: Any = "latitude_longitude_to_poles" if tag == "sphere" else it.get("mapping", "equal_area")
        return GoniometricLight(image, it["position"], rotation, it["intensity"], visibility, mapping, it.get("radius", 0.0))
    if tag == "point" or (tag == "sphere" and it["spot"] is None):
        return PointLight(it["position"], it["intensity"], it.get("radius", 0.0), visibility)
    if tag == "directional":
        return SunLight(it["direction"], it["irradiance"], min(math.degrees(it["angle"]), 180.0), visibility)
    if tag in ("spot", "sphere"):
        spot = it if tag == "spot" else it["spot"]
        inner, outer = (
            math.degrees(math.acos(max(-1.0, min(1.0, spot[name])))) for name in ("cos_inner", "cos_outer")
        )
        more = (spot["falloff"], it.get("radius", 0.0), visibility)
        return SpotLight(it["position"], spot["direction"], it["intensity"], inner, outer, *more)
    if tag == "area":
        transform = MatrixKind().value(it["world_from_light"], names)
        spread = 180.0 if it["spread"] > math.pi else math.degrees(it["spread"])
        shape: Literal["rectangle", "ellipse"] = "ellipse" if it["is_ellipse"] else "rectangle"
        texture = it.get("texture")
        area = AreaLight(transform, it["size"], it["power"], shape, spread, visibility, texture and Texture.of_map(texture, names))
        if it.get("profile") is not None:
            area.profile = names.key_of("image", it["profile"]["image"])
            area.profile_rotation = MatrixKind(3, 3).value(it["profile"]["world_from_light"], names)
        return area
    transform = MatrixKind().value(it["world_from_light"], names)
    fov = math.degrees(it["vertical_fov"])
    picture = Texture.of_map(it["picture"], names)
    return ProjectorLight(picture, transform, it["intensity"], fov, it["aspect"], visibility)


def _place(matrix: Matrix) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Returns the origin of a matrix, and its -z axis."""
    by_rows = rows(matrix, "matrix", 4, 4)
    return tuple(row[3] for row in by_rows[:3]), tuple(-row[2] for row in by_rows[:3])


class PortalsKind(Kind):
    """Rectangles: a corner and two edges each."""

    def check(self, value: Any, name: str) -> Any:
        return tuple(rows(portal, f"{name}[{index}]", 3, 3) for index, portal in enumerate(value))

    def plain(self, value: Any, names: Names) -> Any:
        return [{"corner": corner, "edges": [u, v]} for corner, u, v in value]

    def value(self, plain: Any, names: Names) -> Any:
        return tuple((portal["corner"], *portal["edges"]) for portal in plain)


@dataclass
class Environment(Value):
    """Radiance along rays that leave the scene.

    - `radiance`: R G B in W·sr⁻¹·m⁻²; multiplies the image.
    - `image`: key of its image; `None`: the same in all directions.
    - `mapping`: `latitude_longitude` (the upper edge is +y, the centre column -z, u grows towards +x),
      `latitude_longitude_to_poles` (Mitsuba's) or `equal_area` (pbrt's).
    - `rotation`: (3, 3), from environment to world space.
    - `portals`: rectangles through which alone it shines, each a corner and two edges.
    - `visibility`: the kinds of ray that find it; without `camera` the picture is transparent where it lies.
    """

    radiance: Color = of(ColorKind(), 1.0)
    image: str | None = of(KeyKind("image"), None)
    mapping: Literal["latitude_longitude", "latitude_longitude_to_poles", "equal_area"] = choice(
        "latitude_longitude", "latitude_longitude_to_poles", "equal_area"
    )
    rotation: Matrix = of(MatrixKind(3, 3), IDENTITY3)
    portals: Sequence[Matrix] = of(PortalsKind(), ())
    visibility: Visibility = of(VisibilityKind(), Visibility())

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        return {"factor": plain.pop("radiance"), "world_from_environment": plain.pop("rotation"), **plain}

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Environment:
        members = {"radiance": plain["factor"], "rotation": plain["world_from_environment"]}
        return super().of_plain({**plain, **members}, names)


class FarKind(Kind):
    """A distance that may be infinite."""

    def check(self, value: Any, name: str) -> float:
        return math.inf if value == math.inf else float(reals([value], name, 1, 0.0)[0])


class SurfacesKind(Kind):
    """The surfaces of lenses: rows of radius, thickness, refractive index and radius of the opening."""

    def check(self, value: Any, name: str) -> Any:
        return rows(value, name, len(value), 4)

    def plain(self, value: Any, names: Names) -> Any:
        return [dict(zip(("radius", "thickness", "eta", "aperture_radius"), row)) for row in value]

    def value(self, plain: Any, names: Names) -> Any:
        return tuple((it["radius"], it["thickness"], it["eta"], it["aperture_radius"]) for it in plain)


@dataclass
class Lenses(Value):
    """A system of lenses in front of a film, as in pbrt's camera `realistic`. All lengths are in scene units.

    - `surfaces`: a row per surface, from the scene to the film: radius of curvature (above 0 if the centre lies towards the film; 0: a
      stop), distance to the next surface or to the film, refractive index behind it (1: air), radius of its opening.
    - `film_diagonal`: of the film, which has the shape of the picture.
    - `focus_distance`: from the film to the plane in focus; `None`: the film stays where the last distance puts it.
    """

    surfaces: Sequence[Sequence[float]] = of(SurfacesKind(), ...)
    film_diagonal: float = plain_real(0.035)
    focus_distance: float | None = of(MaybeRealKind(), None)


@dataclass
class Camera(Value):
    """A camera at the origin of `transform`, (4, 4), from camera space to world space, without scale; it looks along -z, +y is up.

    - `projection`: `perspective` with `fov` (full angle along `fov_axis`'s vertical measure, in degrees), `orthographic` with
      `height` (in scene units), `fisheye` or `equisolid_fisheye` with `fisheye_fov` (full angle of its circle, in degrees) and
      `circle_height` (height of the picture in diameters of the circle), or a panorama: `equirectangular` (-z in the middle, +x to the
      right of it), `equal_area`, `cube` (six squares: +x -x +y -y +z -z).
    - `aspect`: width over height of the picture that `fov` and `height` belong to; `None`: they are vertical.
      `fov_axis`: the extent that stays in a picture of another aspect: `x`, `y`, `diagonal`, `smaller`, `larger`.
    - `lens_radius`: in scene units; 0: everything is sharp. `focus_distance`: of the sharp plane.
    - `blades`: corners of the lens's opening; 0: it is round. `blade_rotation`: counterclockwise, in degrees. `aperture_ratio`: its
      height over its width.
    - `lenses`: replace the lens of a perspective camera; `fov` then has no effect on the picture.
    - `stereo`: two pictures in one, `side_by_side` or `top_bottom`, or that of one eye, `left` or `right`. The eyes are `eye_distance`
      apart; their pictures agree at `convergence`.
    - `rolling_shutter`: share of the shutter's time for which a row is exposed, row by row from the upper edge; `None`: all at once.
    - `shift`: of the optical axis, right and up, in halves of the picture's width and height.
    - `near`, `far`: distances of the clip planes along the axis.
    - `medium`: key of the medium around it. `hides_emitters`: it does not see emitters.
    """

    transform: Matrix = of(MatrixKind(), IDENTITY4)
    fov: float = plain_real(40.0, 0.001, 179.999)
    projection: Literal[
        "perspective", "orthographic", "equirectangular", "equal_area", "cube", "fisheye", "equisolid_fisheye"
    ] = choice("perspective", "orthographic", "equirectangular", "equal_area", "cube", "fisheye", "equisolid_fisheye")
    height: float = plain_real(2.0)
    aspect: float | None = of(MaybeRealKind(), None)
    pixel_aspect: float = plain_real(1.0)
    fov_axis: Literal["x", "y", "diagonal", "smaller", "larger"] = of(
        ChoiceKind("x", "y", "diagonal", "smaller", "larger"), "y"
    )
    lens_radius: float = plain_real(0.0)
    focus_distance: float = plain_real(1.0)
    shift: Vector = of(VectorKind(2), (0.0, 0.0))
    near: float = plain_real(0.0)
    far: float = of(FarKind(), math.inf)
    medium: str | None = of(KeyKind("medium"), None)
    hides_emitters: bool = flag(False)
    fisheye_fov: float = plain_real(180.0, 0.001, 360.0)
    circle_height: float = plain_real(1.0)
    blades: int = of(CountKind(1000), 0)
    blade_rotation: float = plain_real(0.0, -1e6, 1e6)
    aperture_ratio: float = plain_real(1.0, 1e-6, 1e6)
    lenses: Lenses | None = of(ValueKind(Lenses), None)
    stereo: Literal["side_by_side", "top_bottom", "left", "right"] | None = of(
        MaybeChoiceKind("side_by_side", "top_bottom", "left", "right"), None
    )
    eye_distance: float = plain_real(0.0625)
    convergence: float = of(FarKind(), math.inf)
    rolling_shutter: float | None = of(MaybeRealKind(), None)

    @classmethod
    def looking(
        cls, eye: Vector, target: Vector, *, up: Vector = (0.0, 1.0, 0.0), fov: float = 40.0, **fields: Any
    ) -> Camera:
        """Makes a camera at `eye` that looks at `target`; it is focused there."""
        eye, target = reals(eye, "eye", 3), reals(target, "target", 3)
        distance = math.dist(eye, target)
        back = _unit(tuple(a - b for a, b in zip(eye, target)), "target", "it lies at `eye`")
        right = _unit(_cross(reals(up, "up", 3), back), "up", "it has no length, or points along the view")
        axes = (right, _cross(back, right), back, eye)
        matrix = (*(tuple(axis[row] for axis in axes) for row in range(3)), (0.0, 0.0, 0.0, 1.0))
        return cls(matrix, fov, **{"focus_distance": distance, **fields})

    def plain_fields(self, names: Names) -> dict[str, Any]:
        plain = super().plain_fields(names)
        fov, height, kind = plain.pop("fov"), plain.pop("height"), plain.pop("projection")
        fisheye_fov, circle_height = plain.pop("fisheye_fov"), plain.pop("circle_height")
        projection: dict[str, Any] = {"panorama": kind}
        if kind == "perspective":
            projection = {kind: {"vertical_fov": math.radians(fov)}}
        elif kind == "orthographic":
            projection = {kind: {"height": height}}
        elif kind in _FISHEYES:
            fov = math.radians(fisheye_fov)
            projection = {"fisheye": {"mapping": _FISHEYES[kind], "field_of_view": fov, "height": circle_height}}
        far, layout = plain.pop("far"), plain.pop("stereo")
        eye_distance, convergence = plain.pop("eye_distance"), plain.pop("convergence")
        stereo = {
            "layout": layout,
            "eye_distance": eye_distance,
            "convergence": None if convergence == math.inf else convergence,
        }
        return {
            "name": "",
            "world_from_camera": plain.pop("transform"),
            "projection": projection,
            "lens_shift": plain.pop("shift"),
            "clip": {"near": plain.pop("near"), "far": None if far == math.inf else far},
            "aperture": {
                "blades": plain.pop("blades"),
                "rotation": math.radians(plain.pop("blade_rotation")),
                "ratio": plain.pop("aperture_ratio"),
            },
            "stereo": None if layout is None else stereo,
            **plain,
        }

    @classmethod
    def of_plain(cls, plain: dict[str, Any], names: Names) -> Camera:
        ((kind, members),) = plain["projection"].items()
        far, aperture, stereo = plain["clip"]["far"], plain["aperture"], plain.get("stereo")
        fisheye: dict[str, Any] = members if kind == "fisheye" else {"mapping": "equidistant", "field_of_view": math.pi, "height": 1.0}
        if kind == "panorama":
            kind = members
        elif kind == "fisheye":
            kind = next(name for name, mapping in _FISHEYES.items() if mapping == fisheye["mapping"])
        more = {
            "transform": plain["world_from_camera"],
            "projection": kind,
            "fov": math.degrees(members["vertical_fov"]) if kind == "perspective" else 40.0,
            "height": members["height"] if kind == "orthographic" else 2.0,
            "shift": plain["lens_shift"],
            "near": plain["clip"]["near"],
            "far": math.inf if far is None else far,
            "fisheye_fov": min(math.degrees(fisheye["field_of_view"]), 360.0),
            "circle_height": fisheye["height"],
            "blades": aperture["blades"],
            "blade_rotation": math.degrees(aperture["rotation"]),
            "aperture_ratio": aperture["ratio"],
            "lenses": plain.get("lenses"),
            "stereo": stereo and stereo["layout"],
            "eye_distance": stereo["eye_distance"] if stereo else 0.0625,
            "convergence": math.inf if not stereo or stereo["convergence"] is None else stereo["convergence"],
            "rolling_shutter": plain.get("rolling_shutter"),
        }
        return super().of_plain({**plain, **more}, names)


# The laws of fisheyes, by the names of their projections.
_FISHEYES = {"fisheye": "equidistant", "equisolid_fisheye": "equisolid"}


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, ...]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(vector: Sequence[float], name: str, problem: str) -> tuple[float, ...]:
    length = math.hypot(*vector)
    if not length > 0:
        raise SceneError(f"`{name}`: {problem}; choose another one")
    return tuple(member / length for member in vector)


@dataclass
class Sphere(Value):
    """A sphere that is not triangulated. `material`: its key. `rotation`: a quaternion x y z w that turns its texture.

    `visibility`: the kinds of ray for which it is there.
    """

    center: Vector = of(VectorKind(), ...)
    radius: float = plain_real(...)
    material: str = of(KeyKind("material", False), ...)
    rotation: Vector = of(VectorKind(4), (0.0, 0.0, 0.0, 1.0))
    visibility: Visibility = of(VisibilityKind(), Visibility())

    def plain_fields(self, names: Names) -> dict[str, Any]:
        place = {"center": self.center, "radius": self.radius, "world_from_object": self.rotation}
        return {**place, "material": 0, "visibility": self.visibility.bits}
