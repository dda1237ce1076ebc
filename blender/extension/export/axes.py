# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates: Blender's +z is up, Bottega's +y is up. (x, y, z) becomes (x, z, -y)."""

from __future__ import annotations

from typing import Any

import numpy as np

TURN = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
"""World of Bottega from world of Blender, (4, 4)."""


def turned(matrix: Any) -> np.ndarray:
    """Returns a matrix to Blender's world as a matrix to Bottega's world, (4, 4), float64."""
    return TURN @ np.array(matrix, np.float64)


def rows(matrix: np.ndarray) -> list[list[float]]:
    """Returns a (4, 4) matrix as a list of rows, whose last is exactly 0 0 0 1."""
    return [*matrix[:3].tolist(), [0.0, 0.0, 0.0, 1.0]]


def without_scale(matrix: np.ndarray) -> np.ndarray:
    """Returns a matrix whose axes have length 1 and are right-handed; its origin stays."""
    result = np.eye(4)
    x, y, z = (matrix[:3, column] for column in range(3))
    z = _unit(z, (0.0, 0.0, 1.0))
    x = _unit(x - z * (x @ z), _across(z))
    result[:3, 0], result[:3, 1], result[:3, 2], result[:3, 3] = x, np.cross(z, x), z, matrix[:3, 3]
    return result


def _unit(vector: np.ndarray, otherwise: Any) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-12 else np.array(otherwise, np.float64)


def _across(z: np.ndarray) -> np.ndarray:
    """Returns a direction at right angles to z."""
    other = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    return _unit(np.cross(other, z), (1.0, 0.0, 0.0))
