# SPDX-License-Identifier: GPL-3.0-or-later
"""The backdrop: a sphere far around the scene, there for camera rays alone, that shows the camera another world than lights the scene."""

from __future__ import annotations

import bottega
import numpy as np

from .context import visibility_for
from .instances import Pass
from .world import Backdrop

BACKDROP = "backdrop"
# Radius of the sphere, in extents of the scene: directions from anywhere in the scene differ by a ten thousandth.
_FAR = 1e4


def extent_of(found: Pass) -> float:
    """Returns the greatest distance of a vertex of the scene from the origin, or somewhat more; at least 1."""
    extent = 1.0
    boxes = [(group.bounds, group.rows) for group in found.groups.values()]
    boxes += [([tuple(corner) for corner in item.bound_box], [row]) for _, item, row in found.volumes]
    for bounds, rows in boxes:
        corners = np.ones((8, 4), np.float64)
        corners[:, :3] = bounds
        placed = corners @ found.matrices[rows].astype(np.float64).transpose(0, 2, 1)
        distances = np.linalg.norm(placed[..., :3], axis=-1)
        extent = max(extent, float(np.nan_to_num(distances, posinf=0.0).max(initial=0.0)))
    return extent


def put_backdrop(scene: bottega.Scene, backdrop: Backdrop, extent: float) -> None:
    """Puts a backdrop into a scene, or replaces it. `extent`: of the scene, from the origin."""
    scene.materials[BACKDROP] = bottega.Material(bottega.Diffuse(0.0), emission=backdrop.emission, emission_sides="both")
    center, radius = (0.0, 0.0, 0.0), _FAR * extent
    scene.spheres[BACKDROP] = bottega.Sphere(center, radius, BACKDROP, backdrop.rotation, visibility_for(["camera"]))
