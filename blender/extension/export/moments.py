# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves while the shutter is open: the scene is evaluated at the times of all keys, and what is needed of it is copied.

Nothing that points into Blender outlives the evaluation at its time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Callable

import bpy
import numpy as np

from .hair import shape_of_hair
from .instances import Pass, gather
from .meshes import Shape, shape_of
from .nodes import uid_of
from .shutter import Shutter

# Kinds of data whose shape may change.
GEOMETRY = ("Object", "Mesh", "Curve", "Curves", "TextCurve", "SurfaceCurve", "MetaBall", "ParticleSettings")


@dataclass(frozen=True)
class Habit:
    """How an object moves, by Cycles' settings: `steps`, 2^steps + 1 keys; 0: it stands still. `deforms`: its vertices move, too."""

    steps: int = 1
    deforms: bool = True


@dataclass
class Moment:
    """The scene at a time.

    - `time`: in frames, from the frame of the picture.
    - `matrices`, `ids`: of the instances; see `Pass`.
    - `camera`: from its space to Blender's world, (4, 4). `lens`: what its angle depends on.
    - `shapes`: of meshes that change over time. `shape_of_row`: the index of the shape of each instance; -1: it has none.
    - `hair`: shapes of hair that changes over time, by key of its mesh.
    """

    time: float
    matrices: Any
    ids: Any
    camera: Any
    lens: tuple[Any, ...]
    shapes: list[Shape] = field(default_factory=list)
    shape_of_row: Any = None
    hair: dict[str, Shape] = field(default_factory=dict)


@dataclass
class Motion:
    """What moves around a frame.

    - `frame`: the frame of the picture. `habits`: of objects, by session number.
    - `moments`: at the times of the keys but for the middle of the span, where everything is exported.
    """

    shutter: Shutter
    frame: int
    habits: dict[Any, Habit]
    moments: list[Moment]


class Clock:
    """Sets the time at which an engine's scene is evaluated, and sets it back at the end."""

    def __init__(self, engine: Any, depsgraph: Any) -> None:
        self._engine, self._depsgraph = engine, depsgraph
        scene = depsgraph.scene
        self.frame, self._subframe = scene.frame_current, scene.frame_subframe
        self._time = 0.0

    def __enter__(self) -> Clock:
        return self

    def __exit__(self, *_: object) -> None:
        self.go(0.0)

    def go(self, time: float) -> None:
        """Evaluates the scene at a time, in frames from the frame of the picture; does nothing at the time at which it is."""
        if time == self._time:
            return
        self._time = time
        frame, subframe = self.frame, self._subframe
        if time != 0.0:
            exact = frame + subframe + time
            frame = math.floor(exact)
            subframe = exact - frame
        self._engine.frame_set(frame, subframe=subframe)


def camera_matrix(engine: Any, camera: Any, depsgraph: Any, turns: bool = False) -> Any:
    """Returns the matrix from the space of a camera to Blender's world, (4, 4), float64.

    `turns`: the eyes of a stereo view turn with the direction, so the matrix is that of the camera between them.
    """
    return np.array(engine.camera_model_matrix(camera.evaluated_get(depsgraph), use_spherical_stereo=turns), np.float64)


def lens_of(camera: Any) -> tuple[Any, ...]:
    """Returns what the angle of an evaluated camera depends on."""
    data = camera.data
    return data.type, data.lens, data.sensor_width, data.sensor_height


def follow(engine: Any, depsgraph: Any, camera: Any, shutter: Shutter, clock: Clock, mark: Callable[[Any], None]) -> Motion:
    """Copies what moves while the shutter is open. The scene is then evaluated at the middle of the span.

    `mark`: called with what each evaluation says has changed.
    """
    habits = _habits(depsgraph)
    motion = Motion(shutter, clock.frame, habits, [])
    changed: set[Any] = set()
    has_changed = False
    steps = max((habit.steps for habit in habits.values()), default=0)
    times = [time for time in shutter.times(steps) if time != shutter.middle] if steps > 0 else []
    # The time at which the scene is now comes last: what changes is known only after an evaluation.
    for time in sorted(times, key=lambda time: time == 0.0):
        if engine.test_break():
            break
        clock.go(time)
        mark(depsgraph.updates)
        changed |= _changed(depsgraph)
        has_changed = has_changed or len(depsgraph.updates) > 0
        if has_changed:
            motion.moments.append(_moment(engine, depsgraph, camera, time, habits, changed))
    clock.go(shutter.middle)
    mark(depsgraph.updates)
    return motion


def _habits(depsgraph: Any) -> dict[Any, Habit]:
    """Returns the habits of all objects by session number."""
    objects = (block for block in depsgraph.ids if isinstance(block, bpy.types.Object))
    return {uid_of(item.original): _habit(getattr(item, "cycles", None)) for item in objects}


def _habit(settings: Any) -> Habit:
    if not getattr(settings, "use_motion_blur", True):
        return Habit(0, False)
    return Habit(max(1, getattr(settings, "motion_steps", 1)), getattr(settings, "use_deform_motion", True))


def _changed(depsgraph: Any) -> set[Any]:
    """Returns the session numbers of objects and data whose shape an evaluation has changed."""
    blocks = (update.id.original for update in depsgraph.updates if update.is_updated_geometry)
    return {uid_of(block) for block in blocks if block.bl_rna.identifier in GEOMETRY}


def _moment(engine: Any, depsgraph: Any, camera: Any, time: float, habits: dict[Any, Habit], changed: set[Any]) -> Moment:
    found = gather(depsgraph, has_ids=True)
    lens = lens_of(camera.evaluated_get(depsgraph))
    made = Moment(time, found.matrices, found.ids, camera_matrix(engine, camera, depsgraph), lens)
    made.shape_of_row = np.full(len(found.matrices), -1, np.int32)
    done: dict[str, int] = {}
    for group in found.groups.values():
        is_changed = group.owner in changed or group.data_owner in changed
        if not is_changed or not habits.get(group.owner, Habit()).deforms:
            continue
        if group.kind != "MESH":
            made.hair[group.mesh_key] = shape_of_hair(group.kind, group.item, group.data)
            continue
        if group.mesh_key not in done:
            done[group.mesh_key] = len(made.shapes)
            made.shapes.append(shape_of(group.data))
        made.shape_of_row[group.rows] = done[group.mesh_key]
    return made


def matching_rows(found: Pass, moment: Moment) -> Any:
    """Returns, for each instance of a pass, its row at a moment, int64, (N,); -1: it is not there."""
    if np.array_equal(found.ids, moment.ids):
        return np.arange(len(found.ids))
    rows: dict[bytes, int] = {}
    for row, number in enumerate(map(bytes, moment.ids)):
        # Those that cannot be told apart stand still.
        rows[number] = -1 if number in rows else row
    return np.array([rows.get(number, -1) for number in map(bytes, found.ids)], np.int64)
