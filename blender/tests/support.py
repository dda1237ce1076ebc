# SPDX-License-Identifier: GPL-3.0-or-later
"""What the checks of the add-on share: it is loaded from the folder `blender/extension`, or from where Blender has installed it."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any

import bpy

HERE = Path(__file__).parent
NAME = "bottega_addon"
# Programs that a check has started; they end with it.
STARTED: list[Any] = []


def addon() -> Any:
    """Returns the add-on, registered."""
    if NAME not in sys.modules:
        place = HERE.parent / "extension"
        spec = importlib.util.spec_from_file_location(NAME, place / "__init__.py", submodule_search_locations=[str(place)])
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[NAME] = module
        spec.loader.exec_module(module)
    module = sys.modules[NAME]
    if not hasattr(bpy.types.Scene, "bottega"):
        module.register()
    return module


def part(name: str) -> Any:
    """Returns a module of the add-on."""
    addon()
    return importlib.import_module(f"{NAME}.{name}")


def arguments() -> list[str]:
    """Returns the arguments of a check, by `bpy` or by `blender --python … -- …`."""
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]


def failed(text: str) -> None:
    """Ends Blender with an error, which `blender --background` would swallow."""
    print(f"FAILED: {text}", flush=True)
    if NAME in sys.modules:
        part("farm").end_programs()
    leave(1)


def leave(code: int = 0) -> None:
    """Ends the process at once: modules of `bpy` crash at the end of the interpreter in some versions."""
    import os

    for program in STARTED:
        program.kill()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def is_same(one: Any, other: Any) -> bool:
    """Returns true if two pictures have the same bits.

    Before 4.1 Blender adds up normals in an order that changes, so two exports may differ in the last bits.
    """
    import numpy as np

    return np.allclose(one, other, 0.0, 1e-3 if bpy.app.version < (4, 1, 0) else 0.0)


def settle(scene: Any, width: int, height: int, samples: int) -> None:
    """Sets size and samples of a picture."""
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    scene.bottega.goal, scene.bottega.samples, scene.bottega.max_depth = "SAMPLES", samples, 12


def picture_of(engine: str, file: Path, samples: int) -> Any:
    """Renders the scene by an engine, as F12 does, and returns the colors: float32, (height, width, 3)."""
    import bottega

    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == "CYCLES":
        unclamped(scene.cycles, samples)
    else:
        scene.bottega.samples = samples
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    return bottega.read(file).color


def layers_of(engine: str, file: Path, samples: int, has_passes: bool = True) -> dict[str, Any]:
    """Renders the scene by an engine, as F12 does, and returns the layers of the file by their last names.

    - `has_passes`: the file has the passes of the view layer, too.
    """
    import bottega

    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == "CYCLES":
        unclamped(scene.cycles, samples)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if has_passes else "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER" if has_passes else "OPEN_EXR", "32"
    settings.color_mode = "RGBA"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    picture = bottega.read(file)
    return {name.rsplit(".", 1)[-1]: picture[name] for name in picture.layers}


def unclamped(cycles: Any, samples: int) -> None:
    """Makes Cycles find all light: no clamping, all caustics, no denoising."""
    values = {
        "samples": samples, "use_adaptive_sampling": False, "use_denoising": False, "sample_clamp_indirect": 0.0,
        "sample_clamp_direct": 0.0, "blur_glossy": 0.0, "light_sampling_threshold": 0.0, "caustics_reflective": True,
        "caustics_refractive": True, "max_bounces": 12, "diffuse_bounces": 12, "glossy_bounces": 12, "transmission_bounces": 12,
        "volume_bounces": 12, "transparent_max_bounces": 32, "device": "CPU",
    }
    for name, value in values.items():
        if hasattr(cycles, name):
            setattr(cycles, name, value)
