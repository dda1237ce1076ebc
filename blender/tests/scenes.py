# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes made by script: each uses a few features of the add-on. `SCENES` has them by name.

The modules `*_scenes` define them by theme, from the parts in `scene_parts`.
"""

from __future__ import annotations

import light_scenes  # noqa: F401
import motion_scenes  # noqa: F401
import volume_scenes  # noqa: F401
from material_scenes import by_ray, groups, procedural
from object_scenes import factory, instances
from scene_parts import SCENES, add_light, ball, blurred, cube, empty, floor, link, matte, moved, nodes, picture, principled, shaded, textured_room
from world_scenes import sky

__all__ = [
    "SCENES",
    "add_light",
    "ball",
    "blurred",
    "by_ray",
    "cube",
    "empty",
    "factory",
    "floor",
    "groups",
    "instances",
    "link",
    "matte",
    "moved",
    "nodes",
    "picture",
    "principled",
    "procedural",
    "shaded",
    "sky",
    "textured_room",
]
