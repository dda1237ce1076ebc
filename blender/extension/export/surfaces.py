# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shader is made of, and how shaders are mixed and added."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from .fields import CannotFold, Field, complement, computed, constant, is_constant_of, scaled

ONE = constant(1.0)
BLACK = constant(0.0, 0.0, 0.0)
WHITE = constant(1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Model:
    """A scattering model whose values are fields. `name`: a class of `bottega`."""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)
    """Fields, plain values, models (of a blend), or `(width, texture)` pairs."""


@dataclass(frozen=True)
class Relief:
    """A relief: `kind` is `normal` or `bump`. `strength`: of a normal map. `height`: of a bump map, in scene units."""

    kind: str
    field: Field
    strength: float = 1.0


@dataclass(frozen=True)
class Shader:
    """A closure: scattering, emission, and the share of light that passes straight through.

    - `model`: `None`: it scatters nothing.
    - `emission`: radiance of the part that is there, a color; the opacity dims it.
    - `opacity`: a number; 0: everything passes.
    - `relief`: bumps of its surface.
    """

    model: Model | None = None
    emission: Field = BLACK
    opacity: Field = ONE
    relief: Relief | None = None

    @property
    def is_clear(self) -> bool:
        """True if everything passes, and nothing is emitted."""
        return self.model is None and is_constant_of(self.opacity, 0.0) and is_constant_of(self.emission, 0.0)


CLEAR = Shader(opacity=constant(0.0))


def mixed(share: Field, first: Shader, second: Shader) -> Shader:
    """Returns the mix of two shaders. `share`: weight of the second. Raises `CannotFold`."""
    if is_constant_of(share, 0.0):
        return first
    if is_constant_of(share, 1.0):
        return second
    rest = complement(share)
    weights = scaled(rest, first.opacity), scaled(share, second.opacity)
    opacity = _sum(*weights)
    emission = _over(_sum(scaled(first.emission, weights[0]), scaled(second.emission, weights[1])), opacity)
    relief = first.relief or second.relief
    if first.model is None and second.model is None:
        return Shader(None, emission, opacity, relief)
    if is_constant_of(weights[0], 0.0) or is_constant_of(weights[1], 0.0):
        model = second.model if is_constant_of(weights[0], 0.0) else first.model
        return Shader(model, emission, opacity, relief)
    if is_constant_of(first.opacity, 1.0) and is_constant_of(second.opacity, 1.0):
        weight = share
    else:
        weight = computed("share", 1, lambda part, whole: part / (whole + (whole == 0)), weights[1], opacity)
    model = Model("Blend", {"weight": weight, "first": first.model or _BLACK, "second": second.model or _BLACK})
    return Shader(model, emission, opacity, relief)


_BLACK = Model("Diffuse", {"reflectance": BLACK})


def added(first: Shader, second: Shader) -> Shader:
    """Returns the sum of two shaders. Raises `CannotFold`."""
    relief = first.relief or second.relief
    lights = [scaled(one.emission, one.opacity) for one in (first, second)]
    for one, other in ((first, second), (second, first)):
        if other.model is None and is_constant_of(other.opacity, 1.0) and not one.is_clear:
            # Light alone is added to a surface, which may be clear in part.
            return Shader(one.model, _over(_sum(*lights), one.opacity), one.opacity, relief)
    emission = _sum(*lights)
    models = [one.model or (_CLEAR_SHEET if one.is_clear else None) for one in (first, second)]
    if models[0] is None or models[1] is None:
        return Shader(models[0] or models[1], emission, relief=relief)
    return Shader(Model("Sum", {"first": models[0], "second": models[1]}), emission, relief=relief)


_CLEAR_SHEET = Model("Transparent", {"color": WHITE})


def _over(light: Field, opacity: Field) -> Field:
    """Returns the radiance of what is there, from that of all of it."""
    if is_constant_of(light, 0.0) or is_constant_of(opacity, 1.0):
        return light
    return computed("over", 3, lambda color, part: color / (part + (part == 0)), light, opacity)


def _sum(a: Field, b: Field) -> Field:
    if is_constant_of(a, 0.0):
        return b
    if is_constant_of(b, 0.0):
        return a
    return computed("sum", max(a.channels, b.channels), lambda x, y: x + y, a, b)


def with_relief(shader: Shader, relief: Relief | None) -> Shader:
    """Returns a shader with a relief, unless it has one."""
    return shader if relief is None or shader.relief is not None else replace(shader, relief=relief)
