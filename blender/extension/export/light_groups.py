# SPDX-License-Identifier: GPL-3.0-or-later
"""Light groups: the lights of a view layer's groups, by their names in the scene of the renderer."""

from __future__ import annotations

from typing import Any, Iterable

from .instances import Pass
from .report import Fidelity, Report

# The most groups of a picture.
GROUPS_MAX = 16
# The name of the environment in the renderer.
ENVIRONMENT = "environment"


def light_groups_of(found: Pass, world: Any, world_lights: Iterable[str], report: Report) -> dict[str, list[str]]:
    """Returns the names of the lights of each group: lamps, meshes that may glow, and the world.

    - `world_lights`: names of the lights that stand for a part of the world.
    """
    groups: dict[str, set[str]] = {}
    owners: dict[str, set[str]] = {}
    for key, light, _ in found.lights:
        groups.setdefault(_group(light), set()).add(key)
    for group in found.groups.values():
        groups.setdefault(_group(group.item), set()).add(group.mesh_key)
        owners.setdefault(group.mesh_key, set()).add(_group(group.item))
    if world is not None:
        groups.setdefault(_group(world), set()).update([ENVIRONMENT, *world_lights])
    report.begin("light groups")
    shared = sorted(mesh_key for mesh_key, names in owners.items() if len(names) > 1)
    for mesh_key in shared:
        name = next(group.data.name for group in found.groups.values() if group.mesh_key == mesh_key)
        text = "objects of several groups share this mesh: its light is in all of them"
        report.add("light groups", name, "Light Group", Fidelity.APPROXIMATED, text)
    return {name: sorted(lights) for name, lights in groups.items() if name}


def _group(block: Any) -> str:
    """Returns the light group of an object or a world; empty: none, or a version of Blender without any."""
    return getattr(block, "lightgroup", "")
