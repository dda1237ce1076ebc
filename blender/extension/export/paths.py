# SPDX-License-Identifier: GPL-3.0-or-later
"""The paths of objects, meshes, lights and cameras through the moments of a motion, as keys for the renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mathutils import Matrix

from . import axes
from .instances import Group, Pass, parents_of, placeable
from .meshes import Shape
from .moments import Habit, Moment, Motion, matching_rows
from .nodes import uid_of

Array = Any

# Parts into which the path of a spot that turns is divided between two keys: the renderer turns lights around the origin of the world.
PIECES = 8


@dataclass(frozen=True)
class Path:
    """Times, and a matrix, or one for each instance, at each: float64, (K, 4, 4), or float32, (K, N, 4, 4)."""

    times: tuple[float, ...]
    matrices: Array

    def keys(self) -> list[tuple[float, Array]]:
        """Returns the keys as the renderer takes them."""
        return list(zip(self.times, self.matrices))


def is_same_path(one: Path | None, other: Path | None) -> bool:
    """Returns true if two paths have the same keys."""
    if one is None or other is None:
        return one is other
    return one.times == other.times and np.array_equal(one.matrices, other.matrices)


class Paths:
    """Finds the keys of what a pass over the middle of the span has found."""

    def __init__(self, motion: Motion, found: Pass, depsgraph: Any) -> None:
        self.shutter, self._found = motion.shutter, found
        self._habits = motion.habits
        self._moments: dict[float, Moment] = {moment.time: moment for moment in motion.moments}
        self._rows = {time: matching_rows(found, moment) for time, moment in self._moments.items()}
        self._depsgraph = depsgraph
        self._parents: dict[int, tuple[Any, Any]] | None = None
        self._has_habits = any(habit != Habit() for habit in self._habits.values())

    def _parent(self, row: int) -> tuple[Any, Any]:
        """Returns the object and the particle system that make an instance."""
        if self._parents is None:
            self._parents = parents_of(self._depsgraph)
        return self._parents.get(row, (None, None))

    def _habit(self, group: Group, row: int) -> Habit:
        """Returns the habit of an instance: that of its object and of what makes it."""
        habit = self._habits.get(group.owner, Habit())
        if not self._has_habits or not group.is_instance:
            return habit
        parent = self._parent(row)[0]
        other = habit if parent is None else self._habits.get(uid_of(parent.original), Habit())
        if habit.steps == 0 or other.steps == 0:
            return Habit(0, False)
        return Habit(max(habit.steps, other.steps), habit.deforms and other.deforms)

    def _times(self, steps: int) -> list[float]:
        """Returns the times of the keys for a number of steps, as far as they were evaluated."""
        middle = self.shutter.middle
        return [time for time in self.shutter.times(steps) if time == middle or time in self._moments]

    def lasting(self, group: Group, rows: Array) -> Array:
        """Returns which instances are there all the time, (N,): Cycles leaves out particles that are not. All others are."""
        kept = np.ones(len(rows), bool)
        if not group.is_instance:
            return kept
        some = np.any([row_then[rows] < 0 for row_then in self._rows.values()], axis=0) if self._rows else ~kept
        for index in np.nonzero(some)[0]:
            row = int(rows[index])
            steps = self._habit(group, row).steps
            times = self._times(steps) if steps > 0 else []
            is_missing = any(time in self._rows and self._rows[time][row] < 0 for time in times)
            kept[index] = not is_missing or self._parent(row)[1] is None
        return kept

    def of_instances(self, group: Group, rows: Array) -> Path | None:
        """Returns the path of instances of a group in the renderer's world; `None`: they stand still."""
        if not self._moments or len(rows) == 0:
            return None
        habits = [self._habit(group, row) for row in rows] if self._has_habits else [self._habit(group, rows[0])]
        steps = max(habit.steps for habit in habits)
        times = self._times(steps) if steps > 0 else []
        here = self._found.matrices[rows]
        matrices = np.array([self._at(time, rows, here) for time in times])
        if len(times) < 2 or not (matrices != here).any():
            return None
        # Those stand still that are switched off, mirrored on the way, or flat or nowhere at some time.
        good = placeable(matrices, group.bounds).all(axis=0)
        with np.errstate(all="ignore"):
            signs = np.sign(np.linalg.det(matrices[..., :3, :3].astype(np.float64)))
        good &= (signs == signs[0]).all(axis=0)
        if len(habits) == len(rows):
            good &= np.array([habit.steps > 0 for habit in habits])
        matrices[:, ~good] = here[~good]
        return Path(tuple(times), np.ascontiguousarray(axes.TURN.astype(np.float32) @ matrices))

    def _at(self, time: float, rows: Array, here: Array) -> Array:
        """Returns the matrices of instances at a time; `here`: those in the middle, which instances keep that are not there."""
        if time not in self._moments:
            return here
        others = self._rows[time][rows]
        return np.where((others >= 0)[:, None, None], self._moments[time].matrices[others], here)

    def shapes_of(self, group: Group) -> list[tuple[float, Shape]]:
        """Returns the shapes of a mesh at the times of its keys but the middle; empty: its vertices do not move."""
        habit = self._deforming(group)
        found = []
        for time in self._times(habit.steps) if habit.deforms else ():
            if time in self._moments:
                moment, row = self._moments[time], self._rows[time][group.rows[0]]
                index = moment.shape_of_row[row] if row >= 0 else -1
                if index >= 0:
                    found.append((time, moment.shapes[index]))
        return found

    def _deforming(self, group: Group) -> Habit:
        return self._habit(group, group.rows[0])

    def deforms(self, group: Group) -> bool:
        """Returns true if the vertices of a mesh may move."""
        return self._deforming(group).deforms

    def hair_changes(self, group: Group, shape: Shape) -> bool:
        """Returns true if hair has another shape than now at some time."""
        others = (moment.hair.get(group.mesh_key) for moment in self._moments.values())
        return any(other is not None and not other.equals(shape) for other in others)

    def of_light(self, light: Any, row: int) -> Path | None:
        """Returns the path of a light from where it is in the middle, in the renderer's world; `None`: it stands still, as suns do."""
        steps = self._habits.get(uid_of(light.original), Habit()).steps
        times = self._times(steps) if steps > 0 else []
        here, rows = self._found.matrices[row].astype(np.float64), np.array([row])
        matrices = [self._at(time, rows, here[None])[0].astype(np.float64) for time in times]
        kind = light.data.type
        if kind == "SUN" or len(times) < 2 or all(np.array_equal(matrix, here) for matrix in matrices):
            return None
        placed, start = [axes.turned(matrix) for matrix in matrices], axes.turned(here)
        # The renderer cannot turn the axis of a spot with a radius.
        if kind == "POINT" or (kind == "SPOT" and light.data.shadow_soft_size > 0.0):
            placed, start = [_shift(matrix) for matrix in placed], _shift(start)
        elif kind == "SPOT":
            times, placed = _finely(times, [axes.without_scale(matrix) for matrix in placed])
            start = axes.without_scale(start)
        sizes = [np.linalg.det(matrix[:3, :3]) for matrix in (start, *placed)]
        if not all(np.isfinite(size) and abs(size) > 1e-24 and size * sizes[0] > 0.0 for size in sizes):
            return None
        moved = np.array([matrix @ np.linalg.inv(start) for matrix in placed])
        moved[:, 3] = (0.0, 0.0, 0.0, 1.0)
        return Path(tuple(times), moved)

    def of_camera(self, camera: Any, here: Array) -> tuple[list[tuple[float, Array]], list[tuple[Any, ...]]]:
        """Returns the times and matrices of a camera in Blender's world, and what its angle depends on; none: it stands still.

        `camera`: the evaluated object. `here`: its matrix in the middle.
        """
        steps = self._habits.get(uid_of(camera.original), Habit()).steps
        times = self._times(steps) if steps > 0 else []
        keys = [(time, self._moments[time].camera if time in self._moments else here) for time in times]
        lenses = [self._moments[time].lens for time in times if time in self._moments]
        is_still = all(np.array_equal(matrix, here) for _, matrix in keys)
        return [] if is_still else keys, lenses


def _shift(matrix: Array) -> Array:
    """Returns a matrix without anything but its origin."""
    result = np.eye(4)
    result[:3, 3] = matrix[:3, 3]
    return result


def _finely(times: list[float], matrices: list[Array]) -> tuple[list[float], list[Array]]:
    """Divides a path of matrices without scale into shorter parts, if it turns."""
    if all(np.array_equal(matrix[:3, :3], matrices[0][:3, :3]) for matrix in matrices):
        return times, matrices
    finer_times, finer = [times[0]], [matrices[0]]
    for index in range(1, len(times)):
        (one, from_), (other, to) = ((times[index + step], Matrix(matrices[index + step].tolist())) for step in (-1, 0))
        for piece in range(1, PIECES + 1):
            share = piece / PIECES
            turn = from_.to_quaternion().slerp(to.to_quaternion(), share)
            place = from_.translation.lerp(to.translation, share)
            finer_times.append(one + (other - one) * share)
            finer.append(np.array(Matrix.Translation(place) @ turn.to_matrix().to_4x4(), np.float64))
    return finer_times, finer
