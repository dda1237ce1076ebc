# SPDX-License-Identifier: GPL-3.0-or-later
"""Placements: a group of instances, split where its materials differ by the values of the objects or by the kind of ray."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Iterable, Iterator

import bottega

from .context import Context, Placed, Values, rays_of, values_of, visibility_for
from .families import DEFAULT, Families
from .instances import Group, Pass, parents_of
from .nodes import uid_of
from .report import Fidelity, Report

# The most materials that one material of Blender becomes by values of objects.
MOST_VALUES = 256
# How often what materials depend on may be found to be more than was known.
MOST_ROUNDS = 5


@dataclass(frozen=True)
class Placement:
    """Instances of a mesh with the same materials, for some kinds of ray.

    - `key`: of the object in the scene. `rows`: indices of the instances in the pass.
    - `materials`: keys by slot.
    """

    key: str
    group: Group
    rows: list[int]
    materials: list[str]
    visibility: bottega.Visibility


def placements_of(depsgraph: Any, found: Pass, families: Families, report: Report) -> list[Placement]:
    """Returns the placements of all groups of a pass over an evaluated scene; their materials are read."""
    for _ in range(MOST_ROUNDS):
        before = {uid: set(family.asks) for uid, family in families.by_uid.items()}
        families.begin_round()
        chosen = _choices(depsgraph, found, families, report)
        placed = [one for group in found.groups.values() for one in _split(group, families, chosen)]
        if all(families.by_uid[uid].asks == asks for uid, asks in before.items()):
            break
    return placed


def _names(families: Families, uid: Any) -> set[str]:
    return families.by_uid[uid].asks - {"ray"}


def _choices(depsgraph: Any, found: Pass, families: Families, report: Report) -> dict[tuple[Any, int], Values]:
    """Returns the values of the object by material and row, for materials that depend on them; at most so many for each material."""
    chosen: dict[tuple[Any, int], Values] = {}
    kinds: dict[Any, set[Values]] = {}
    asks = {name for family in families.by_uid.values() for name in family.asks}
    parents = parents_of(depsgraph) if any(name.startswith("instancer ") for name in asks) else {}
    for group in found.groups.values():
        for uid in {uid_of(material.original) for material in group.slots if material is not None}:
            names = _names(families, uid)
            if names and uid not in kinds:
                report.begin(f"values {uid}")
            for row in group.rows if names else ():
                placed = _placed(found, group, row, parents)
                values = values_of(placed, names)
                chosen[uid, row] = values
                kinds.setdefault(uid, set()).add(values)
                if _may_lack(placed, values):
                    text = "an attribute that Geometry Nodes give to instances is left out: it is 0"
                    report.add(f"values {uid}", families.by_uid[uid].name, "Attribute", Fidelity.LEFT_OUT, text)
    for uid, values in kinds.items():
        key, family = f"values {uid}", families.by_uid[uid]
        if len(values) <= MOST_VALUES:
            continue
        text = f"{len(values)} different values of objects are rendered as {MOST_VALUES} nearby ones"
        report.add(key, family.name, "Object Info", Fidelity.APPROXIMATED, text)
        ordered = sorted(values)
        nearby = {one: ordered[_middle(index, len(ordered))] for index, one in enumerate(ordered)}
        for place in [place for place in chosen if place[0] == uid]:
            chosen[place] = nearby[chosen[place]]
    return chosen


def _may_lack(placed: Placed, values: Values) -> bool:
    """Returns true if a value that was not found may be an attribute of instances, which Python cannot read."""
    if placed.parent is None or not any(name.startswith("instancer ") and not any(value) for name, value in values):
        return False
    return any(modifier.type == "NODES" for modifier in placed.parent.modifiers)


def _middle(index: int, count: int) -> int:
    """Returns the index of the value in the middle of the bin that an index falls into."""
    bin_ = index * MOST_VALUES // count
    low, high = -(-bin_ * count // MOST_VALUES), -(-(bin_ + 1) * count // MOST_VALUES)
    return (low + high - 1) // 2


def _placed(found: Pass, group: Group, row: int, parents: dict[int, tuple[Any, Any]]) -> Placed:
    parent, particles = parents.get(row, (None, None))
    random_id = int(found.random_ids[row]) if group.is_instance else None
    return Placed(group.item, found.matrices[row], random_id, parent, particles)


def _split(group: Group, families: Families, chosen: dict[tuple[Any, int], Values]) -> Iterator[Placement]:
    """Yields the placements of a group."""
    uids = [None if material is None else uid_of(material.original) for material in group.slots]
    parts: dict[tuple[Values, ...], list[int]] = {}
    for row in group.rows:
        parts.setdefault(tuple(chosen.get((uid, row), ()) for uid in uids), []).append(row)
    for number, (values, rows) in enumerate(parts.items()):
        by_materials: dict[tuple[str, ...], list[str]] = {}
        for ray in _rays(group, families, uids):
            keys = tuple(DEFAULT if uid is None else families.key(uid, Context(ray, own)) for uid, own in zip(uids, values))
            by_materials.setdefault(keys, []).append(ray)
        for index, (keys, rays) in enumerate(by_materials.items()):
            part = f" part {number} {index}" if number or index else ""
            visibility = group.visibility if len(by_materials) == 1 else visibility_for(rays)
            yield Placement(group.key + part, group, rows, list(keys), visibility)


def _rays(group: Group, families: Families, uids: Iterable[Any]) -> list[str]:
    """Returns the kinds of ray for which the materials of a group are needed; one stands for all if they do not depend on it."""
    if not any(uid is not None and "ray" in families.by_uid[uid].asks for uid in uids):
        return ["camera"]
    return rays_of(group.visibility) or ["camera"]
