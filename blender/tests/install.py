# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs a zip into a fresh profile and renders the scene that Blender starts with: `install.py ZIP PICTURE`."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import bpy


def arguments() -> list[str]:
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]


def main() -> None:
    archive, picture = arguments()
    bpy.ops.wm.read_factory_settings()
    if bpy.app.version >= (4, 2, 0):
        bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
        name = "bl_ext.user_default.bottega"
    else:
        bpy.ops.preferences.addon_install(filepath=archive)
        bpy.ops.preferences.addon_enable(module="bottega_blender")
        name = "bottega_blender"
    if name not in bpy.context.preferences.addons:
        print(f"FAILED: {name} is not enabled")
        os._exit(1)
    scene = bpy.context.scene
    scene.render.engine = "BOTTEGA"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    scene.bottega.samples = 16
    scene.render.filepath = str(Path(picture).resolve())
    begun = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    import bottega

    library = sys.modules[f"{name}.library"]
    programs = {program: str(library.program(program)) for program in ("bottega", "nats-server")}
    print(f"INSTALLED Blender {bpy.app.version_string}, bottega {bottega.__version__}, F12 in {time.perf_counter() - begun:.1f} s; {programs}")
    sys.stdout.flush()
    os._exit(0 if Path(picture).is_file() else 1)


main()
