# SPDX-License-Identifier: GPL-3.0-or-later
"""What the values of nodes depend on beside the surface: the kind of the ray, and the object that has the material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Iterable

import bottega
import numpy as np

# The kinds of ray, as `bottega.Visibility` names them.
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume", "shadow")
BOUNCES = RAYS[1:5]
# What an output of the node Light Path is for a kind of ray; those that are not here are 0 for all kinds.
LIGHT_PATH: dict[str, dict[str, float]] = {
    "Is Camera Ray": {"camera": 1.0},
    "Is Shadow Ray": {"shadow": 1.0},
    "Is Diffuse Ray": {"diffuse": 1.0},
    "Is Glossy Ray": {"glossy": 1.0, "transmission": 1.0},
    "Is Singular Ray": {},
    "Is Reflection Ray": {"diffuse": 1.0, "glossy": 1.0},
    "Is Transmission Ray": {"transmission": 1.0},
    "Is Volume Scatter Ray": {"volume": 1.0},
    "Ray Depth": {"diffuse": 1.0, "glossy": 1.0, "transmission": 1.0, "volume": 1.0, "shadow": 1.0},
}
# Outputs of Light Path that tell more apart than kinds of ray do, and what is rendered.
ROUGHLY = {
    "Is Singular Ray": "it is 0 for all rays",
    "Ray Depth": "it is 0 for camera rays, and 1 for all others",
}

Values = tuple[tuple[str, tuple[float, float, float, float]], ...]


@dataclass(frozen=True)
class Context:
    """A kind of ray, and what is known of the object.

    - `ray`: one of `RAYS`.
    - `values`: by name: `random`, `location`, `color` (with alpha), `index`, `object NAME` and `instancer NAME` (properties). A number is
      in all three channels.
    """

    ray: str = "camera"
    values: Values = ()

    def value(self, name: str) -> tuple[float, float, float, float] | None:
        """Returns a value of the object; `None`: it is unknown."""
        return dict(self.values).get(name)


def visibility_for(rays: Iterable[str]) -> bottega.Visibility:
    """Returns the visibility for some kinds of ray."""
    return bottega.Visibility(**{ray: ray in rays for ray in RAYS})


def rays_of(visibility: bottega.Visibility) -> list[str]:
    """Returns the kinds of ray of a visibility."""
    return [ray for ray in RAYS if getattr(visibility, ray)]


@dataclass(frozen=True)
class Placed:
    """An object or an instance of it.

    - `item`: the evaluated object. `matrix`: from its space to Blender's world, (4, 4).
    - `random_id`: Blender's random number of an instance; `None`: it is not an instance.
    - `parent`, `particles`: the object that makes the instance, and its particle system, where a value asks for them.
    """

    item: Any
    matrix: Any
    random_id: int | None
    parent: Any = None
    particles: Any = None


def values_of(placed: Placed, names: Iterable[str]) -> Values:
    """Returns values of an object by name."""
    return tuple((name, _value(placed, name)) for name in sorted(names))


def _value(placed: Placed, name: str) -> tuple[float, float, float, float]:
    item = placed.item
    if name == "random":
        number = _hashed(item.name) if placed.random_id is None else placed.random_id & 0xFFFFFFFF
        return _gray(float(np.float32(number) * np.float32(1.0 / 0xFFFFFFFF)))
    if name == "location":
        x, y, z = (float(value) for value in placed.matrix[:3, 3])
        return x, y, z, 1.0
    if name == "color":
        r, g, b, a = (float(value) for value in item.color)
        return r, g, b, a
    if name == "index":
        return _gray(float(item.pass_index))
    kind, _, property_name = name.partition(" ")
    owners = [item, item.data]
    if kind == "instancer" and placed.parent is not None:
        owners = [placed.particles and placed.particles.settings, placed.parent, *owners]
    found = (_property(owner, property_name) for owner in owners if owner is not None)
    return next((value for value in found if value is not None), (0.0, 0.0, 0.0, 0.0))


def _property(owner: Any, name: str) -> tuple[float, float, float, float] | None:
    """Returns a custom property, or one of Blender's, as Cycles reads it: a number or up to four."""
    value = owner.get(name)
    if value is None:
        try:
            value = owner.path_resolve(name)
        except ValueError:
            return None
    if isinstance(value, (bool, int, float)):
        return _gray(float(value))
    try:
        members = [float(member) for member in value]
    except (TypeError, ValueError):
        return None
    if not 0 < len(members) <= 4:
        return None
    r, g, b, a = [*members, *(0.0, 0.0, 0.0, 1.0)[len(members) :]]
    return r, g, b, a


def _gray(value: float) -> tuple[float, float, float, float]:
    return value, value, value, 1.0


def _hashed(name: str) -> int:
    """Returns Cycles' random number of an object that is not an instance, 32 bits: its name, hashed, and hashed again with 0.

    Source: `hash_string` and `hash_uint2` in Cycles' `util/hash.h` (Bob Jenkins' lookup3).
    """
    key = 0
    for byte in name.encode():
        # Characters of C are signed here.
        key = (key * 37 + (byte if byte < 128 else byte - 256)) & 0xFFFFFFFF
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & 0xFFFFFFFF
    a = (a + key) & 0xFFFFFFFF
    state = [a, b, c]
    for target, source, turn in ((2, 1, 14), (0, 2, 11), (1, 0, 25), (2, 1, 16), (0, 2, 4), (1, 0, 14), (2, 1, 24)):
        turned = ((state[source] << turn) | (state[source] >> (32 - turn))) & 0xFFFFFFFF
        state[target] = ((state[target] ^ state[source]) - turned) & 0xFFFFFFFF
    return state[2]
