# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: of the scene, and of a viewport."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bottega
import numpy as np

from . import axes
from .report import Fidelity, Report


@dataclass(frozen=True)
class Frame:
    """The picture that a camera makes: columns, rows, and the shape of a pixel."""

    width: int
    height: int
    pixel_aspect_x: float = 1.0
    pixel_aspect_y: float = 1.0

    @property
    def extents(self) -> tuple[float, float]:
        """Width and height in units of the same length."""
        return self.width * self.pixel_aspect_x, self.height * self.pixel_aspect_y


def frame_of(render: Any) -> Frame:
    """Returns the frame of the render settings."""
    percent = render.resolution_percentage
    width = max(1, render.resolution_x * percent // 100)
    height = max(1, render.resolution_y * percent // 100)
    return Frame(width, height, render.pixel_aspect_x, render.pixel_aspect_y)


@dataclass(frozen=True)
class Eye:
    """The eye of a stereo view.

    `shift_x`: the shift of its camera. `side`: `left` or `right` in a panorama whose eyes turn with the direction; else `None`.
    """

    shift_x: float
    side: str | None = None


def camera_of(camera: Any, matrix: Any, frame: Frame, report: Report, eye: Eye | None = None) -> bottega.Camera:
    """Returns the camera of an object of type CAMERA, for a frame.

    `camera`: the evaluated object. `matrix`: from its space to the world. `eye`: that of a stereo view; `None`: there is one view.
    """
    data = camera.data
    width, height = frame.extents
    sensor, fits_height = _sensor(data, frame)
    longest = height if fits_height else width
    fields: dict[str, Any] = {"transform": _placed(matrix), "near": data.clip_start, "far": data.clip_end}

    # Half of the picture's height, at distance 1 or in scene units.
    if data.type == "ORTHO":
        half_height = 0.5 * data.ortho_scale * height / longest
        fields.update(projection="orthographic", height=2.0 * half_height)
    elif data.type == "PERSP":
        half_height = 0.5 * sensor / max(data.lens, 1e-3) * height / longest
        fields.update(fov=_degrees(half_height))
    else:
        if eye is not None and eye.side is not None:
            stereo = data.stereo
            convergence = math.inf if stereo.convergence_mode == "PARALLEL" else max(stereo.convergence_distance, 1e-4)
            fields.update(stereo=eye.side, eye_distance=stereo.interocular_distance, convergence=convergence)
            if not stereo.use_pole_merge:
                note = "at the poles of the panorama the two views are one"
                report.add("camera", camera.name, "Stereoscopy", Fidelity.APPROXIMATED, note)
        return _panorama(camera, frame, fields, report)
    fields["pixel_aspect"] = frame.pixel_aspect_x / frame.pixel_aspect_y
    # Blender's shift is in units of the fitted side, and moves the frame; ours moves the axis within the frame.
    shift_x = data.shift_x if eye is None else eye.shift_x
    fields["shift"] = (-2.0 * shift_x * longest / width, -2.0 * data.shift_y * longest / height)
    fields.update(_depth_of_field(camera, data, matrix))
    return bottega.Camera(**fields)


def camera_keys(path: list[tuple[float, Any]]) -> list[tuple[float, Any]]:
    """Returns the keys of a camera that moves, as `bottega.Camera` has its transform.

    `path`: times, and matrices from the space of the camera to Blender's world.
    """
    return [(time, _placed(matrix)) for time, matrix in path]


def _panorama(camera: Any, frame: Frame, fields: dict[str, Any], report: Report) -> bottega.Camera:
    data = camera.data
    # Blender 5 has these settings itself, earlier ones in Cycles.
    owner = data if hasattr(data, "panorama_type") else getattr(data, "cycles", None)
    kind = str(getattr(owner, "panorama_type", "EQUIRECTANGULAR"))
    fields.update(near=0.0, far=math.inf)
    width, height = frame.extents
    if kind == "FISHEYE_EQUIDISTANT":
        # The circle fills the picture, whatever its shape.
        fields.update(projection="fisheye", fisheye_fov=_of_circle(owner.fisheye_fov), pixel_aspect=frame.height / frame.width)
    elif kind == "MIRRORBALL":
        fields.update(projection="equisolid_fisheye", fisheye_fov=360.0, pixel_aspect=frame.height / frame.width)
    elif kind == "FISHEYE_EQUISOLID":
        sensor, is_by_height = _sensor(data, frame)
        sensor_height = sensor if is_by_height else sensor * height / width
        rim = 2.0 * owner.fisheye_lens * math.sin(0.25 * owner.fisheye_fov)
        fields.update(projection="equisolid_fisheye", fisheye_fov=_of_circle(owner.fisheye_fov))
        fields.update(circle_height=0.5 * sensor_height / rim, pixel_aspect=frame.pixel_aspect_x / frame.pixel_aspect_y)
    else:
        ranges = ("longitude_min", "longitude_max", "latitude_min", "latitude_max")
        whole = (-math.pi, math.pi, -0.5 * math.pi, 0.5 * math.pi)
        is_whole = all(abs(getattr(owner, name, side) - side) < 1e-5 for name, side in zip(ranges, whole))
        note = f"the panorama {kind.lower().replace('_', ' ')} is rendered as an equirectangular one"
        if kind != "EQUIRECTANGULAR" or not is_whole:
            part = note if kind != "EQUIRECTANGULAR" else "the whole sphere is rendered"
            report.add("camera", camera.name, "Panorama", Fidelity.APPROXIMATED, part)
        fields["projection"] = "equirectangular"
    return bottega.Camera(**fields)


def _of_circle(angle: float) -> float:
    return min(math.degrees(angle), 360.0)


def _sensor(data: Any, frame: Frame) -> tuple[float, bool]:
    """Returns the side of the sensor that the picture fits, and true if this is its height."""
    width, height = frame.extents
    is_by_height = data.sensor_fit == "VERTICAL" or (data.sensor_fit == "AUTO" and height > width)
    return (data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width), is_by_height


def _depth_of_field(camera: Any, data: Any, matrix: Any) -> dict[str, Any]:
    if not data.dof.use_dof:
        return {}
    focus = data.dof.focus_object
    if focus is None:
        distance = data.dof.focus_distance
    else:
        to_camera = np.linalg.inv(axes.without_scale(np.array(matrix, np.float64)))
        distance = abs(float((to_camera @ np.array(focus.matrix_world, np.float64))[2, 3]))
    stop = max(data.dof.aperture_fstop, 1e-5)
    radius = 0.5 / stop if data.type == "ORTHO" else 0.5e-3 * data.lens / stop
    lens: dict[str, Any] = {"lens_radius": radius, "focus_distance": max(distance, 1e-4)}
    if data.dof.aperture_blades >= 3:
        lens.update(blades=data.dof.aperture_blades, blade_rotation=math.degrees(data.dof.aperture_rotation))
    return {**lens, "aperture_ratio": min(max(data.dof.aperture_ratio, 1e-4), 1e4)}


def view_camera(region: Any, view: Any, scene: Any, camera: Any, report: Report) -> tuple[bottega.Camera, Frame]:
    """Returns the camera of a 3D view, with its frame.

    `region`, `view`: `context.region` and `context.region_data`; `camera`: the evaluated camera of the scene, or `None`.
    """
    frame = Frame(region.width, region.height)
    window = np.array(view.window_matrix, np.float64)
    to_world = np.linalg.inv(np.array(view.view_matrix, np.float64))
    # The projection is read from the matrix: x / half_width + shift_x, and so on.
    if view.is_perspective:
        half_height = 1.0 / window[1, 1]
        fields: dict[str, Any] = {"fov": _degrees(half_height)}
        shift = (-window[0, 2], -window[1, 2])
    else:
        half_height = 1.0 / window[1, 1]
        fields = {"projection": "orthographic", "height": 2.0 * half_height}
        shift = (window[0, 3], window[1, 3])
    fields["transform"] = _placed(to_world)
    # Pixels of a view are square; rounding of its size is the matrix's own aspect.
    fields["pixel_aspect"] = 1.0
    fields["shift"] = shift
    if view.view_perspective == "CAMERA" and camera is not None and camera.type == "CAMERA" and view.is_perspective:
        fields.update(_depth_of_field(camera, camera.data, camera.matrix_world))
    if not view.is_perspective:
        # The eye of an orthographic view lies amid the scene: it steps back.
        back = np.eye(4)
        back[2, 3] = 0.5 * view.view_distance * 1000.0
        fields["transform"] = _placed(to_world @ back)
    return bottega.Camera(**fields), frame


def _placed(matrix: Any) -> list[list[float]]:
    return axes.rows(axes.without_scale(axes.turned(matrix)))


def _degrees(half_height: float) -> float:
    return min(max(math.degrees(2.0 * math.atan(half_height)), 0.001), 179.99)
