# SPDX-License-Identifier: GPL-3.0-or-later
"""Bottega in Blender: F12, animations and the viewport.

The modules `export.*` turn an evaluated scene into a `bottega.Scene`; `engine` renders it; `settings` and `panels` are what the user sees.
"""

bl_info = {
    "name": "Bottega",
    "author": "The Bottega developers",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Render properties > Render Engine",
    "description": "Physically based renderer that shares a picture out to your machines",
    "category": "Render",
}

from . import library

library.prepare()

from . import bake, engine, farm, farm_pictures, motion_panels, panels, save, settings  # noqa: E402  (the library must be found first)

_MODULES = (settings, engine, bake, panels, motion_panels, farm, farm_pictures, save)


def register() -> None:
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
