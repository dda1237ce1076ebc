# SPDX-License-Identifier: GPL-3.0-or-later
"""The shutter of a scene: the span of time that a picture shows, and how much light it lets pass meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .report import Fidelity, Report

# Places at which the curve of a shutter is read, and ramps that are tried, from 0 to 0.5.
PLACES, RAMPS = 129, 65
# Difference between a curve and a ramp, as a share of the mean, from which it is listed.
LISTED = 0.02


@dataclass(frozen=True)
class Shutter:
    """When the shutter opens and closes, in frames from the frame of the picture, and its ramp; see `bottega.Scene.shutter`."""

    open: float
    close: float
    ramp: float

    @property
    def middle(self) -> float:
        """The middle of the span, at which everything is exported that does not move."""
        return self.times(1)[1]

    def times(self, steps: int) -> list[float]:
        """Returns the times of the keys for a number of Cycles' steps: 2^steps + 1. Those of fewer steps are among those of more."""
        count = 2**steps
        return [self.open + (self.close - self.open) * (index / count) for index in range(count + 1)]


def shutter_of(scene: Any, layer: Any, report: Report) -> Shutter | None:
    """Returns the shutter of an evaluated scene and its view layer; `None`: pictures show one moment."""
    report.begin("shutter")
    render, cycles = scene.render, getattr(scene, "cycles", None)
    length = render.motion_blur_shutter
    if not render.use_motion_blur or not getattr(layer, "use_motion_blur", True) or length <= 0.0:
        return None
    # Before 4.2 the position is a setting of Cycles.
    position = getattr(render, "motion_blur_position", None) or getattr(cycles, "motion_blur_position", "CENTER")
    middle = {"START": 0.5 * length, "END": -0.5 * length}.get(position, 0.0)
    ramp, difference = _ramp_of(render.motion_blur_shutter_curve)
    if difference > LISTED:
        text = f"the curve of the shutter is rendered as one that takes {100 * ramp:.0f} % of the time to open, and as much to close"
        report.add("shutter", scene.name, "Shutter Curve", Fidelity.APPROXIMATED, text)
    return Shutter(middle - 0.5 * length, middle + 0.5 * length, ramp)


def rolling_shutter_of(scene: Any) -> float | None:
    """Returns the share of the shutter's time for which each row is exposed; `None`: all rows at the same time."""
    cycles = getattr(scene, "cycles", None)
    if getattr(cycles, "rolling_shutter_type", "NONE") != "TOP":
        return None
    return min(max(float(cycles.rolling_shutter_duration), 1e-6), 1.0)


def _ramp_of(mapping: Any) -> tuple[float, float]:
    """Returns the ramp nearest to a curve, and the root of the mean square of their difference, as a share of the mean."""
    mapping.initialize()
    places = np.linspace(0.0, 1.0, PLACES)
    curve = np.maximum([mapping.evaluate(mapping.curves[0], float(place)) for place in places], 0.0)
    if not curve.mean() > 0.0:
        # Cycles lets light pass all the time then.
        return 0.0, 0.0
    curve /= curve.mean()

    def difference(ramp: float) -> float:
        edge = np.minimum(places, 1.0 - places)
        shape = np.ones(PLACES) if ramp == 0.0 else np.minimum(edge / ramp, 1.0)
        return float(np.sqrt(np.mean((shape / shape.mean() - curve) ** 2)))

    return min(((float(ramp), difference(ramp)) for ramp in np.linspace(0.0, 0.5, RAMPS)), key=lambda pair: pair[1])
