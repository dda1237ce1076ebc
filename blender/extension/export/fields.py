# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that may vary over a surface: a constant, or a picture with texture coordinates.

A chain of nodes over one picture is folded: the nodes are computed for its pixels, and the result is a new picture.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any, Callable

import numpy as np

Array = Any
Matrix3 = tuple[tuple[float, float, float], ...]
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class CannotFold(Exception):
    """Two pictures with different sizes or coordinates meet in one chain."""


@dataclass(frozen=True)
class Placing:
    """How a picture lies on a surface.

    - `uv_name`: the set of texture coordinates; `None`: the one that is active for rendering.
    - `transform`: (3, 3), from texture coordinates, v upwards, to the picture.
    - `wrap`: `repeat`, `mirror` or `clamp`. `is_smooth`: texels are interpolated.
    """

    uv_name: str | None = None
    transform: Matrix3 = IDENTITY
    wrap: str = "repeat"
    is_smooth: bool = True


@dataclass(frozen=True)
class Field:
    """A number (1 channel) or a color (3 channels), constant or over a picture.

    - `name`: says all that the values depend on; equal names have equal values.
    - `placing`: `None`: a constant.
    - `load`: returns the values: float32, (channels,) or (height, width, channels); row 0 is the lowest.
    - `image`, `channel`: the picture of Blender whose values these are unchanged; `channel` is one of r g b a for a number.
    - `factor`: multiplies an unchanged picture, R G B or a number.
    """

    name: str
    channels: int
    placing: Placing | None
    load: Callable[[], Array]
    image: str | None = None
    channel: str = "r"
    factor: tuple[float, ...] = (1.0,)
    size: tuple[int, int] | None = None

    @property
    def is_constant(self) -> bool:
        """True if it is the same everywhere."""
        return self.placing is None

    def number(self) -> float:
        """Returns the value of a constant, as a number."""
        values = self.load()
        return float(values[0] if self.channels == 1 else luminance(values))

    def key(self) -> str:
        """Returns the key of its folded picture."""
        return "folded " + hashlib.sha256(self.name.encode()).hexdigest()[:24]


def luminance(values: Array) -> Array:
    """Returns the luminance of linear Rec. 709, float32."""
    return values[..., :3] @ np.array([0.2126, 0.7152, 0.0722], np.float32)


def constant(*values: float) -> Field:
    """Returns a constant of 1 or 3 channels."""
    array = np.array(values, np.float32)
    return Field(f"({', '.join(f'{value:.9g}' for value in array)})", len(values), None, lambda: array)


def cached(load: Callable[[], Array]) -> Callable[[], Array]:
    """Returns a function that calls another one once."""
    kept: list[Array] = []

    def once() -> Array:
        if not kept:
            kept.append(load())
        return kept[0]

    return once


def computed(name: str, channels: int, function: Callable[..., Array], *inputs: Field) -> Field:
    """Returns the field of a function of values. The values of the inputs have a last axis of channels and broadcast.

    Raises `CannotFold` if the inputs lie on different pictures.
    """
    varying = [one for one in inputs if not one.is_constant]
    placing = varying[0].placing if varying else None
    size = varying[0].size if varying else None
    for one in varying[1:]:
        if one.placing != placing or one.size != size:
            raise CannotFold("pictures with different sizes or coordinates meet here")
    full = f"{name}({', '.join(one.name for one in inputs)})"

    def load() -> Array:
        values = np.asarray(function(*(one.load() for one in inputs)), np.float32)
        return np.nan_to_num(values, nan=0.0, posinf=3e38, neginf=-3e38)

    if placing is None:
        value = load()
        return Field(full, channels, None, lambda: value)
    return Field(full, channels, placing, cached(load), size=size)


def as_number(field: Field) -> Field:
    """Returns a color as a number, as Blender converts it."""
    if field.channels == 1:
        return field
    return computed("luminance", 1, lambda values: luminance(values)[..., None], field)


def as_color(field: Field) -> Field:
    """Returns a number as a gray color."""
    if field.channels == 3:
        return field
    return computed("gray", 3, lambda values: np.repeat(values, 3, axis=-1), field)


def scaled(field: Field, factor: Field) -> Field:
    """Returns the product of two fields. A picture times a constant stays the picture."""
    if factor.is_constant and not field.is_constant and field.image is not None:
        value = factor.load()
        scale = tuple(float(a * b) for a, b in zip(np.broadcast_to(field.factor, (field.channels,)), np.broadcast_to(value, (field.channels,))))
        name = f"{field.name}*{scale}"
        return replace(field, name=name, factor=scale, load=cached(lambda: field.load() * value))
    if field.is_constant and not factor.is_constant and factor.image is not None and factor.channels >= field.channels:
        return scaled(factor, field)
    channels = max(field.channels, factor.channels)
    return computed("product", channels, lambda a, b: a * b, field, factor)


def is_constant_of(field: Field, value: float) -> bool:
    """Returns true for a constant whose channels all have a value."""
    return field.is_constant and bool(np.all(np.abs(field.load() - value) < 1e-7))


def complement(field: Field) -> Field:
    """Returns 1 minus a number."""
    return computed("1-", field.channels, lambda values: 1.0 - values, field)
