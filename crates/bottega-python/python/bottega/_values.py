"""The base of the values of a scene: dataclasses whose fields are checked, and which tell their owner of changes."""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Callable, Literal, Protocol, TypeVar, Union

from ._errors import SceneError

Triple = tuple[float, float, float]
Wrap = Literal["repeat", "mirror", "clamp"]
Channel = Literal["r", "g", "b", "a"]

FACTOR_MAX = 1e15
"""The greatest factor of a light or a material."""


class Names(Protocol):
    """The scene's numbers of images and media, by which its JSON texts refer to them."""

    def number(self, kind: str, key: str) -> int: ...

    def key_of(self, kind: str, number: int) -> str | None: ...


class Kind:
    """What a field may hold: `check` returns the value as it is kept, `plain` as JSON, `value` from JSON."""

    def check(self, value: Any, name: str) -> Any:
        return value

    def plain(self, value: Any, names: Names) -> Any:
        return value

    def value(self, plain: Any, names: Names) -> Any:
        return plain


def wrong(name: str, value: object, needed: str) -> SceneError:
    return SceneError(f"`{name}` is {value!r}: {needed}")


def real(value: Any, name: str, low: float = -math.inf, high: float = math.inf) -> float:
    """Returns a finite number within limits."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise wrong(name, value, "a number is needed")
    number = float(value)
    if not math.isfinite(number):
        raise wrong(name, value, "a finite number is needed")
    if not low <= number <= high:
        limits = f"from {low:g} to {high:g}" if high < FACTOR_MAX else f"{low:g} or more, up to 1e15,"
        raise wrong(name, value, f"{limits} is allowed")
    return number


def reals(value: Any, name: str, count: int, low: float = -math.inf, high: float = math.inf) -> tuple[float, ...]:
    """Returns a number of finite numbers, such as those of an array."""
    try:
        members = list(value)
    except TypeError:
        raise wrong(name, value, f"{count} numbers are needed") from None
    if len(members) != count:
        raise wrong(name, value, f"{count} numbers are needed, not {len(members)}")
    return tuple(real(member, f"{name}[{index}]", low, high) for index, member in enumerate(members))


def rows(value: Any, name: str, count: int, columns: int) -> tuple[tuple[float, ...], ...]:
    """Returns a matrix as a tuple of rows."""
    try:
        members = list(value)
    except TypeError:
        raise wrong(name, value, f"a matrix of {count} rows and {columns} columns is needed") from None
    if len(members) != count:
        raise SceneError(f"`{name}` has {len(members)} rows: {count} rows of {columns} numbers are needed")
    return tuple(reals(member, f"{name}[{row}]", columns) for row, member in enumerate(members))


@dataclass
class Value:
    """A value of a scene. A value that was taken out of a scene writes its changes back into it."""

    def __setattr__(self, name: str, value: Any) -> None:
        kind = _kinds(type(self)).get(name)
        if kind is None:
            raise AttributeError(f"{type(self).__name__} has no field `{name}`; it has {', '.join(_kinds(type(self)))}")
        checked = kind.check(value, name)
        if isinstance(checked, Value):
            # Another owner keeps its own: changes of one do not show in the other.
            checked = checked.copied()
            checked.__dict__["_changed"] = self._tell
        before, had = self.__dict__.get(name), name in self.__dict__
        self.__dict__[name] = checked
        try:
            self._tell()
        except Exception:
            if had:
                self.__dict__[name] = before
            raise

    def _tell(self) -> None:
        changed: Callable[[], None] | None = self.__dict__.get("_changed")
        if changed is not None:
            changed()

    def copied(self: Self) -> Self:
        """Returns an equal value that belongs to no scene."""
        copy = object.__new__(type(self))
        for name in _kinds(type(self)):
            member = self.__dict__[name]
            if isinstance(member, Value):
                member = member.copied()
                member.__dict__["_changed"] = copy._tell
            copy.__dict__[name] = member
        return copy

    def plain_fields(self, names: Names) -> dict[str, Any]:
        """Returns all fields as JSON."""
        return {name: kind.plain(self.__dict__[name], names) for name, kind in _kinds(type(self)).items()}

    @classmethod
    def of_plain(cls: type[Self], plain: dict[str, Any], names: Names) -> Self:
        """Makes a value from the fields of a JSON text."""
        return cls(**{name: kind.value(plain[name], names) for name, kind in _kinds(cls).items()})


Self = TypeVar("Self", bound=Value)


def _kinds(cls: type[Value]) -> dict[str, Kind]:
    kinds: dict[str, Kind] | None = cls.__dict__.get("_kinds_by_name")
    if kinds is None:
        kinds = {member.name: member.metadata["kind"] for member in fields(cls)}
        cls._kinds_by_name = kinds  # type: ignore[attr-defined]
    return kinds


def of(kind: Kind, default: Any) -> Any:
    """Declares a field of a kind; `...`: it must be given."""
    if default is ...:
        return field(metadata={"kind": kind})
    if isinstance(default, Value):
        return field(default_factory=default.copied, metadata={"kind": kind})
    return field(default=default, metadata={"kind": kind})


@dataclass
class RealKind(Kind):
    """A number within limits."""

    low: float = 0.0
    high: float = FACTOR_MAX

    def check(self, value: Any, name: str) -> float:
        return real(value, name, self.low, self.high)


@dataclass
class CountKind(Kind):
    """A whole number."""

    high: int = 2**32 - 1

    def check(self, value: Any, name: str) -> int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral) or not 0 <= int(value) <= self.high:
            raise wrong(name, value, f"a whole number from 0 to {self.high} is needed")
        return int(value)


class FlagKind(Kind):
    """True or false."""

    def check(self, value: Any, name: str) -> bool:
        if not isinstance(value, bool):
            raise wrong(name, value, "True or False is needed")
        return value


class ChoiceKind(Kind):
    """One of several words."""

    def __init__(self, *words: str) -> None:
        self.words = words

    def check(self, value: Any, name: str) -> str:
        if value not in self.words:
            raise wrong(name, value, f"one of {', '.join(map(repr, self.words))} is needed")
        return str(value)


class MaybeChoiceKind(ChoiceKind):
    """One of several words, or `None`."""

    def check(self, value: Any, name: str) -> Any:
        return None if value is None else super().check(value, name)


@dataclass
class VectorKind(Kind):
    """Several numbers within limits."""

    count: int = 3
    low: float = -math.inf
    high: float = math.inf

    def check(self, value: Any, name: str) -> tuple[float, ...]:
        return reals(value, name, self.count, self.low, self.high)

    def value(self, plain: Any, names: Names) -> Any:
        return tuple(plain)


class DirectionKind(VectorKind):
    """A direction; its length has no meaning."""

    def check(self, value: Any, name: str) -> tuple[float, ...]:
        direction = super().check(value, name)
        length = math.hypot(*direction)
        if length == 0:
            raise wrong(name, value, "a direction has a length above 0")
        return tuple(member / length for member in direction)


class ColorKind(VectorKind):
    """A color R G B, or one number for a gray."""

    def __init__(self) -> None:
        super().__init__(3, 0.0, FACTOR_MAX)

    def check(self, value: Any, name: str) -> tuple[float, ...]:
        if isinstance(value, numbers.Real):
            return (real(value, name, self.low, self.high),) * 3
        return super().check(value, name)


class FactorKind(ColorKind):
    """A factor R G B, or one number for all; may be negative."""

    def __init__(self) -> None:
        super().__init__()
        self.low = -FACTOR_MAX


class WrapKind(Kind):
    """A pair of words."""

    def check(self, value: Any, name: str) -> Any:
        words = ("repeat", "mirror", "clamp")
        pair = () if isinstance(value, str) or not isinstance(value, Sequence) else tuple(value)
        if len(pair) != 2 or not set(pair) <= set(words):
            raise wrong(name, value, f"a pair is needed, along u and along v, of {', '.join(map(repr, words))}")
        return pair


class MaybeRealKind(Kind):
    """A number above 0, or `None`."""

    def check(self, value: Any, name: str) -> float | None:
        if value is not None and real(value, name) <= 0:
            raise wrong(name, value, "a number above 0, or None, is needed")
        return None if value is None else float(value)


@dataclass
class MatrixKind(Kind):
    """A matrix by rows, for column vectors. JSON has its first `kept` rows, column by column."""

    size: int = 4
    kept: int = 3

    def check(self, value: Any, name: str) -> tuple[tuple[float, ...], ...]:
        matrix = rows(value, name, self.size, self.size)
        last = (0.0,) * (self.size - 1) + (1.0,)
        if self.kept < self.size and matrix[-1] != last:
            raise SceneError(f"`{name}` has the last row {matrix[-1]}: {last} is needed; the matrix multiplies columns")
        return matrix

    def plain(self, value: Any, names: Names) -> Any:
        return [value[row][column] for column in range(self.size) for row in range(self.kept)]

    def value(self, plain: Any, names: Names) -> Any:
        kept = tuple(tuple(plain[column * self.kept + row] for column in range(self.size)) for row in range(self.kept))
        return kept if self.kept == self.size else (*kept, (0.0, 0.0, 0.0, 1.0))


IDENTITY4 = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
IDENTITY3 = tuple(tuple(float(row == column) for column in range(3)) for row in range(3))


@dataclass
class KeyKind(Kind):
    """The key of an image or a medium of the scene; `None`: none."""

    kind: str
    is_optional: bool = True

    def check(self, value: Any, name: str) -> str | None:
        if isinstance(value, str) or (value is None and self.is_optional):
            return value
        raise wrong(name, value, f"the key of a {self.kind} of the scene is needed")

    def plain(self, value: Any, names: Names) -> Any:
        return None if value is None else names.number(self.kind, value)

    def value(self, plain: Any, names: Names) -> Any:
        return None if plain is None else names.key_of(self.kind, plain)


_RAYS = ("camera", "diffuse", "glossy", "transmission", "volume", "shadow")


@dataclass
class Visibility(Value):
    """The kinds of ray for which an object, a sphere or a light is there, by the event that a ray leaves.

    - `camera`: rays of the camera. `diffuse`, `glossy`: reflected by such a lobe; a mirror is glossy. `transmission`: transmitted through
      a surface. `volume`: scattered within a medium.
    - `shadow`: it casts a shadow. Without effect for lights.

    Where `diffuse`, `glossy`, `transmission` and `volume` are not all equal, paths are traced one by one and learn nothing, and photons and
    lighting agents are refused.
    """

    camera: bool = of(FlagKind(), True)
    diffuse: bool = of(FlagKind(), True)
    glossy: bool = of(FlagKind(), True)
    transmission: bool = of(FlagKind(), True)
    volume: bool = of(FlagKind(), True)
    shadow: bool = of(FlagKind(), True)

    @property
    def bits(self) -> int:
        """The flags as bits, `camera` first."""
        return sum(getattr(self, name) << place for place, name in enumerate(_RAYS))

    @classmethod
    def of_bits(cls, bits: int) -> Visibility:
        """Makes a value from its bits."""
        return cls(*(bool(bits >> place & 1) for place in range(len(_RAYS))))


class VisibilityKind(Kind):
    """Kinds of ray."""

    def check(self, value: Any, name: str) -> Visibility:
        if not isinstance(value, Visibility):
            raise wrong(name, value, "a bottega.Visibility is needed")
        return value

    def plain(self, value: Any, names: Names) -> Any:
        return value.bits

    def value(self, plain: Any, names: Names) -> Any:
        return Visibility.of_bits(plain)


Number = Union[float, "Texture"]
"""A number, or a channel of a texture."""
Color = Union[float, Sequence[float], "Texture"]
"""Linear R G B, one number for a gray, or a texture."""


@dataclass
class Texture(Value):
    """An image of the scene on a surface.

    - `image`: its key in `scene.images`.
    - `factor`: multiplies the image: a number, or R G B for a color.
    - `channel`: the channel of which a number is taken.
    - `uv_set`: 0 or 1, the texture coordinates `uvs` or `uvs2` of the mesh. v runs downwards: (0, 0) is the upper left corner.
    - `transform`: (3, 3), from texture coordinates to the image, for columns (u, v, 1).
    - `wrap`: what lies beyond the edge, along u and along v. `smooth`: texels are interpolated.
    """

    image: str = of(KeyKind("image", False), ...)
    factor: float | Sequence[float] = of(FactorKind(), 1.0)
    channel: Channel = of(ChoiceKind("r", "g", "b", "a"), "r")
    uv_set: int = of(CountKind(255), 0)
    transform: Sequence[Sequence[float]] = of(MatrixKind(3, 2), IDENTITY3)
    wrap: Sequence[Wrap] = of(WrapKind(), ("repeat", "repeat"))
    smooth: bool = of(FlagKind(), True)

    def map(self, names: Names) -> dict[str, Any]:
        """Returns the texture without factor and channel as JSON."""
        along_u, along_v = self.wrap
        return {
            "image": names.number("image", self.image),
            "uv_set": self.uv_set,
            "picture_from_uv": MatrixKind(3, 2).plain(self.transform, names),
            "wrap_u": along_u,
            "wrap_v": along_v,
            "smooth": self.smooth,
        }

    @classmethod
    def of_map(cls, plain: dict[str, Any], names: Names, factor: Any = 1.0, channel: Channel = "r") -> Texture:
        """Makes a texture from JSON."""
        x = plain["picture_from_uv"]
        transform = ((x[0], x[2], x[4]), (x[1], x[3], x[5]), (0.0, 0.0, 1.0))
        return cls(
            names.key_of("image", plain["image"]) or "",
            factor,
            channel,
            plain["uv_set"],
            transform,
            (plain["wrap_u"], plain["wrap_v"]),
            plain["smooth"],
        )


@dataclass
class TextureKind(Kind):
    """A texture of numbers that are not colors, or `None`."""

    has_channel: bool = False

    def check(self, value: Any, name: str) -> Texture | None:
        if value is None or isinstance(value, Texture):
            return value
        raise wrong(name, value, "a Texture or None is needed")

    def plain(self, value: Any, names: Names) -> Any:
        if value is None:
            return None
        return [value.map(names), value.channel] if self.has_channel else value.map(names)

    def value(self, plain: Any, names: Names) -> Any:
        if plain is None:
            return None
        return Texture.of_map(plain[0], names, channel=plain[1]) if self.has_channel else Texture.of_map(plain, names)


@dataclass
class NumberKind(Kind):
    """A number within limits, or a channel of a texture."""

    low: float = 0.0
    high: float = FACTOR_MAX

    def check(self, value: Any, name: str) -> float | Texture:
        if isinstance(value, Texture):
            if len(set(FactorKind().check(value.factor, f"{name}.factor"))) > 1:
                raise wrong(f"{name}.factor", value.factor, "one number is needed, because this is not a color")
            return value
        return real(value, name, self.low, self.high)

    def plain(self, value: Any, names: Names) -> Any:
        if isinstance(value, Texture):
            factor = FactorKind().check(value.factor, "factor")[0]
            return {"factor": factor, "texture": [value.map(names), value.channel]}
        return {"factor": value, "texture": None}

    def value(self, plain: Any, names: Names) -> Any:
        if plain["texture"] is None:
            return plain["factor"]
        texture, channel = plain["texture"]
        return Texture.of_map(texture, names, plain["factor"], channel)


class TexturedColorKind(ColorKind):
    """A color, or a texture."""

    def check(self, value: Any, name: str) -> Any:
        return value if isinstance(value, Texture) else super().check(value, name)

    def plain(self, value: Any, names: Names) -> Any:
        if isinstance(value, Texture):
            return {"factor": ColorKind().check(value.factor, "factor"), "texture": value.map(names)}
        return {"factor": value, "texture": None}

    def value(self, plain: Any, names: Names) -> Any:
        factor = tuple(plain["factor"])
        return factor if plain["texture"] is None else Texture.of_map(plain["texture"], names, factor)


@dataclass
class ValueKind(Kind):
    """Another value of a class, or `None`."""

    cls: type[Value]
    is_optional: bool = True

    def check(self, value: Any, name: str) -> Any:
        if isinstance(value, self.cls) or (value is None and self.is_optional):
            return value
        raise wrong(name, value, f"a {self.cls.__name__}{' or None' if self.is_optional else ''} is needed")

    def plain(self, value: Any, names: Names) -> Any:
        return None if value is None else value.plain_fields(names)

    def value(self, plain: Any, names: Names) -> Any:
        return None if plain is None else self.cls.of_plain(plain, names)


def number(default: Any, low: float = 0.0, high: float = FACTOR_MAX) -> Any:
    """Declares a number that may have a texture."""
    return of(NumberKind(low, high), default)


def color(default: Any) -> Any:
    """Declares a color that may have a texture."""
    return of(TexturedColorKind(), default)


def plain_real(default: Any, low: float = 0.0, high: float = FACTOR_MAX) -> Any:
    """Declares a number without texture."""
    return of(RealKind(low, high), default)


def flag(default: bool) -> Any:
    """Declares a field that is true or false."""
    return of(FlagKind(), default)


def choice(*words: str) -> Any:
    """Declares one of several words, by default the first."""
    return of(ChoiceKind(*words), words[0])
