# SPDX-License-Identifier: GPL-3.0-or-later
"""Final pictures: the request, and the passes that Blender gets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping, Sequence, Union

import bottega
import numpy as np

from .export.camera import Frame
from .export.light_groups import GROUPS_MAX
from .export.report import Fidelity, Report

# What the name of a light group's pass begins with, as in Cycles.
GROUP_PASS = "Combined_"
# The name of the pass of shadow catchers, as in Cycles.
CATCHER_PASS = "Shadow Catcher"

Layers = Union[bottega.Picture, bottega.ImageFile, Mapping[str, Any]]


@dataclass(frozen=True)
class PassInfo:
    """A pass of Blender: its name, channels, and the letters of the channels."""

    name: str
    channels: int
    letters: str
    kind: str


@dataclass(frozen=True)
class Finish:
    """What is done to a picture of the renderer for Blender.

    - `reach`: what is farther away is a backdrop, which passes do not show; `None`: there is none.
    """

    reach: float | None = None


def passes_of(scene: Any, layer: Any) -> list[PassInfo]:
    """Returns the passes of a view layer beside Combined."""
    settings = scene.bottega
    wanted = [
        (layer.use_pass_z, PassInfo("Depth", 1, "Z", "VALUE")),
        (layer.use_pass_normal, PassInfo("Normal", 3, "XYZ", "VECTOR")),
        (layer.use_pass_mist, PassInfo("Mist", 1, "Z", "VALUE")),
        (settings.use_albedo, PassInfo("Albedo", 3, "RGB", "COLOR")),
        (settings.use_sample_count, PassInfo("Sample Count", 1, "X", "VALUE")),
        (settings.use_cost, PassInfo("Cost", 1, "X", "VALUE")),
        (settings.use_shadow_catcher, PassInfo(CATCHER_PASS, 3, "RGB", "COLOR")),
    ]
    groups = [PassInfo(GROUP_PASS + name, 3, "RGB", "COLOR") for name in groups_of(layer)]
    return [info for is_wanted, info in wanted if is_wanted] + groups


def groups_of(layer: Any) -> list[str]:
    """Returns the names of a view layer's light groups, as many as a picture may have."""
    return [group.name for group in getattr(layer, "lightgroups", ())][:GROUPS_MAX]


_LAYERS = {"Depth": "depth", "Normal": "normal", "Mist": "depth", "Albedo": "albedo", "Sample Count": "samples", "Cost": "cost"}


def note_passes(layer: Any, report: Report) -> None:
    """Notes the passes that a picture does not have."""
    report.begin("passes")
    if layer.use_pass_vector:
        text = "motion vectors span the shutter's time, not two frames: `bottega render --aov motion` of the exported scene has them"
        report.add("passes", layer.name, "Vector", Fidelity.LEFT_OUT, text)
    for group in list(getattr(layer, "lightgroups", ()))[GROUPS_MAX:]:
        text = f"a picture has {GROUPS_MAX} light groups at most: this one has no pass"
        report.add("light groups", group.name, "Light Group", Fidelity.LEFT_OUT, text)


def request_fields(
    scene: Any,
    layer: Any,
    frame: Frame,
    crop: tuple[int, int, int, int] | None,
    finish: Finish,
    lights: Mapping[str, list[str]],
    catchers: Sequence[str],
) -> dict[str, Any]:
    """Returns the fields of the request for a final picture.

    - `crop`: x0, y0, x1, y1, row 0 on top.
    - `lights`: names of the lights of each light group. `catchers`: names of shadow catchers.
    """
    settings = scene.bottega
    wanted = {_LAYERS[info.name] for info in passes_of(scene, layer) if info.name in _LAYERS}
    if "normal" in wanted and finish.reach is not None:
        wanted.add("depth")
    layers = sorted(wanted)
    fields: dict[str, Any] = {
        "size": (frame.width, frame.height),
        "max_depth": settings.max_depth,
        "denoise": settings.denoise,
        "layers": layers,
        "goal": goal_of(settings),
    }
    groups = {name: lights[name] for name in groups_of(layer) if name in lights}
    if groups:
        fields["light_groups"] = groups
    if catchers:
        fields["shadow_catchers"] = list(catchers)
    if settings.guide == "OFF":
        fields["guide"] = {"by": "none"}
    if settings.optimization != "OFF":
        fields["optimization"] = settings.optimization.lower()
    if settings.use_farm:
        fields["farm"] = {"priority": settings.priority}
    if settings.threads > 0:
        fields["threads"] = settings.threads
    if settings.seed > 0:
        fields["seed"] = settings.seed
    if crop is not None:
        fields["crop"] = crop
    return fields


def goal_of(settings: Any) -> dict[str, Any]:
    """Returns the goal of a request."""
    if settings.goal == "ERROR":
        return {"error": settings.error, "samples": settings.samples}
    if settings.goal == "TIME":
        return {"time": settings.seconds}
    return {"samples": settings.samples}


def crop_of(render: Any, frame: Frame) -> tuple[int, int, int, int] | None:
    """Returns the region of the render settings: x0, y0, x1, y1, row 0 on top; `None`: all."""
    if not render.use_border:
        return None
    # Blender cuts to whole pixels.
    x0, x1 = (int(share * frame.width) for share in (render.border_min_x, render.border_max_x))
    low, high = (int(share * frame.height) for share in (render.border_min_y, render.border_max_y))
    if x1 <= x0 or high <= low:
        return None
    return x0, frame.height - high, x1, frame.height - low


def pixels_of(picture: Layers, info: PassInfo | None, scene: Any, finish: Finish) -> np.ndarray:
    """Returns a pass, or Combined for `None`: float32, (rows × columns, channels), the lowest row first.

    `picture`: layers by name.
    """

    def flipped(layer: Any) -> Any:
        return np.asarray(layer)[::-1]

    if info is None:
        color = flipped(picture["color"])
        pixels = np.empty((*color.shape[:2], 4), np.float32)
        pixels[..., :3] = color
        is_clear = scene.render.film_transparent or "shadow-catcher" in picture
        pixels[..., 3] = flipped(picture["alpha"]) if is_clear and "alpha" in picture else 1.0
        if scene.bottega.use_shadow_catcher and "shadow-catcher" in picture:
            # As in Cycles, shadows are in the pass instead.
            pixels[..., 3] -= flipped(_shadows(picture["shadow-catcher"]))
    elif info.name == "Normal":
        normal = flipped(picture["normal"])
        pixels = np.empty(normal.shape, np.float32)
        pixels[..., 0], pixels[..., 1], pixels[..., 2] = normal[..., 0], normal[..., 2], normal[..., 1]
        np.negative(pixels[..., 1], out=pixels[..., 1])
        if finish.reach is not None:
            pixels[flipped(_distances(picture, finish)) == np.inf] = 0.0
    elif info.name == "Mist":
        pixels = mist(flipped(_distances(picture, finish)), scene.world)
    elif info.name == "Depth":
        depth = flipped(_distances(picture, finish))
        pixels = np.where(np.isfinite(depth) & (depth > 0.0), depth, np.float32(1e10))
    elif info.name == CATCHER_PASS:
        # Without catchers nothing lacks light.
        white = np.ones_like(picture["color"])
        pixels = flipped(picture["shadow-catcher"])[..., :3] if "shadow-catcher" in picture else white
    elif info.name.startswith(GROUP_PASS):
        # A group without lights is black.
        name = "light_" + info.name[len(GROUP_PASS) :]
        pixels = flipped(picture[name] if name in picture else np.zeros_like(picture["color"]))
    else:
        pixels = flipped(picture[_LAYERS[info.name]])
    height, width = pixels.shape[:2]
    return np.ascontiguousarray(pixels, np.float32).reshape(height * width, -1)


def _shadows(caught: Any) -> Any:
    """Returns what the shadows on catchers have added to alpha, from the layer of catchers."""
    return caught[..., 3] * np.clip(1.0 - np.asarray(caught[..., :3]).mean(-1), 0.0, 1.0)


def _distances(picture: Layers, finish: Finish) -> Any:
    """Returns the distances of a picture, which are infinite where it shows a backdrop."""
    depth = np.asarray(picture["depth"])
    return depth if finish.reach is None else np.where(depth > 2.0 * finish.reach, np.inf, depth)


def mist(depth: Any, world: Any) -> Any:
    """Returns Blender's mist of distances: 0 before its start, 1 behind its end."""
    if world is None:
        return np.ones_like(depth)
    settings = world.mist_settings
    near = np.where(np.isfinite(depth) & (depth > 0.0), depth, np.inf)
    share = np.clip((near - settings.start) / max(settings.depth, 1e-6), 0.0, 1.0)
    curve = {"QUADRATIC": np.square, "LINEAR": np.positive, "INVERSE_QUADRATIC": np.sqrt}[settings.falloff]
    return settings.intensity + (1.0 - settings.intensity) * curve(share)
