# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers: the objects that are marked as such, by their names in the scene of the renderer."""

from __future__ import annotations

from typing import Any

from .instances import Pass
from .report import Fidelity, Report


def shadow_catchers_of(found: Pass, scene: Any, report: Report) -> list[str]:
    """Returns the names of the meshes of all shadow catchers."""
    catchers: set[str] = set()
    others: set[str] = set()
    for group in found.groups.values():
        (catchers if is_catcher(group.item) else others).add(group.mesh_key)
    report.begin("shadow catchers")
    for group in found.groups.values():
        if group.mesh_key in catchers & others and is_catcher(group.item):
            text = "objects that are no shadow catchers share its mesh, and become some"
            report.add("shadow catchers", group.item.name, "Shadow Catcher", Fidelity.APPROXIMATED, text)
    if catchers and not scene.render.film_transparent:
        text = "the film is transparent: neither the world nor catchers are shown"
        report.add("shadow catchers", scene.name, "Shadow Catcher", Fidelity.APPROXIMATED, text)
    return sorted(catchers)


def is_catcher(item: Any) -> bool:
    """Returns whether an object is a shadow catcher; false in versions of Blender without any."""
    return bool(getattr(item, "is_shadow_catcher", False))
