# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport: frames that become finer while Blender stays usable."""

from __future__ import annotations

import threading
import time
import weakref
from typing import Any

import bottega
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import farm
from .export import Export
from .export.camera import Frame, view_camera
from .export.report import Report

# Seconds for which the thread of a view waits for a frame, before it looks whether the view has ended.
WAIT = 0.25
# Seconds between two redraws.
PAUSE = 0.03


class View:
    """A 3D view: one export, one `bottega.Viewport`, and a thread that asks Blender to draw when there is a finer frame.

    `engine`: the engine that Blender made for the view.
    """

    _all: weakref.WeakSet[View] = weakref.WeakSet()

    def __init__(self, engine: Any) -> None:
        self.export = Export()
        self.viewport: bottega.Viewport | None = None
        self._engine = weakref.proxy(engine)
        self._looked: tuple[Any, ...] = ()
        # The farm whose free machines help, and its address.
        self._farm: tuple[str | None, bottega.Farm] | None = None
        self._pixels = np.zeros((0, 0, 4), np.float32)
        self._texture: Any = None
        self._frame: Any = None
        self._is_open = True
        self._waiter = threading.Thread(target=self._wait, args=(engine.tag_redraw,), name="bottega view", daemon=True)
        self._waiter.start()
        View._all.add(self)

    @classmethod
    def end_all(cls) -> None:
        """Ends all views, as when the add-on is switched off."""
        for view in list(cls._all):
            view.end()

    def end(self) -> None:
        """Ends rendering."""
        self._is_open = False
        if self.viewport is not None:
            self.viewport.stop()

    def update(self, context: Any, depsgraph: Any) -> None:
        """Takes over what has changed in the scene, and shows it."""
        space = context.space_data

        def is_shown(item: Any) -> bool:
            return space is None or not hasattr(item, "visible_in_viewport_get") or item.visible_in_viewport_get(space)

        self.export.mark(depsgraph.updates)
        try:
            self.export.update(depsgraph, is_shown)
            if self.viewport is None:
                self._start(context, depsgraph)
            elif not self._look(context, depsgraph):
                self.viewport.update()
        except bottega.Error as error:
            self._say(f"Bottega: {error}")

    def _start(self, context: Any, depsgraph: Any) -> None:
        if self.viewport is not None:
            self.viewport.stop()
        settings = depsgraph.scene.bottega
        camera, frame = self._camera(context, depsgraph)
        fields: dict[str, Any] = {"spp": settings.view_samples, "max_depth": settings.max_depth}
        if settings.view_denoise:
            fields["denoise"] = True
        helpers = self._linked() if settings.view_farm else None
        viewport = bottega.Viewport(self.export.scene, size=(frame.width, frame.height), camera=camera, farm=helpers, **fields)
        viewport.start()
        self.viewport, self._looked = viewport, self._state(context, depsgraph.scene)

    def _linked(self) -> bottega.Farm | None:
        """Returns the farm; `None`: it is out of reach, and this machine renders alone."""
        address = farm.address()
        if self._farm is None or self._farm[0] != address:
            try:
                self._farm = (address, bottega.Farm(address))
            except bottega.FarmError as error:
                self._engine.report({"WARNING"}, f"Bottega: the viewport renders without the farm: {error}")
                return None
        return self._farm[1]

    def _help(self) -> str:
        """Returns what the machines of the farm do, to be said beside the samples; empty: none helps."""
        assert self.viewport is not None
        helping = [machine for machine in self.viewport.machines if machine.refused is None]
        if not helping:
            return ""
        sent = sum(machine.bytes_per_second for machine in helping) / 1e6
        return f", {1 + len(helping)} machines, {sent:.1f} MB/s"

    def _camera(self, context: Any, depsgraph: Any) -> tuple[bottega.Camera, Frame]:
        camera = depsgraph.scene.camera
        evaluated = camera.evaluated_get(depsgraph) if camera is not None else None
        return view_camera(context.region, context.region_data, depsgraph.scene, evaluated, Report())

    def _state(self, context: Any, scene: Any) -> tuple[Any, ...]:
        """Returns all that the look depends on: first the settings of the viewport, then the view."""
        region, view, settings = context.region, context.region_data, scene.bottega
        matrices = tuple(tuple(row) for matrix in (view.view_matrix, view.window_matrix) for row in matrix)
        return (settings.view_samples, settings.view_denoise, settings.max_depth, settings.view_farm), (region.width, region.height, matrices)

    def _look(self, context: Any, depsgraph: Any) -> bool:
        """Shows another view, if it has changed. Returns true if so."""
        state = self._state(context, depsgraph.scene)
        if state == self._looked or self.viewport is None:
            return False
        if state[0] != self._looked[0]:
            self._start(context, depsgraph)
            return True
        camera, frame = self._camera(context, depsgraph)
        self.viewport.look(size=(frame.width, frame.height), camera=camera)
        self._looked = state
        return True

    def _wait(self, redraw: Any) -> None:
        """Asks for a redraw whenever there is a frame that was not copied."""
        while self._is_open:
            viewport = self.viewport
            if viewport is None or not viewport.wait(WAIT):
                time.sleep(PAUSE)
                continue
            try:
                redraw()
            except ReferenceError:
                return
            time.sleep(PAUSE)

    def draw(self, context: Any, depsgraph: Any) -> None:
        """Draws the latest frame, and shows another view if it has turned."""
        if self.viewport is None:
            self.update(context, depsgraph)
        try:
            self._look(context, depsgraph)
        except bottega.Error as error:
            self._say(f"Bottega: {error}")
        if self.viewport is None:
            return
        if self._pixels.shape != self.viewport.shape:
            self._pixels = np.zeros(self.viewport.shape, np.float32)
        frame = self.viewport.frame_into(self._pixels)
        if frame is not None and frame != self._frame:
            self._frame = frame
            self._texture = _texture_of(self._pixels)
            self._say(f"{frame.samples} samples{self._help()}" if frame.samples else "Coarse")
        if self._texture is not None:
            self._paint(context, depsgraph.scene)

    def _paint(self, context: Any, scene: Any) -> None:
        gpu.state.blend_set("ALPHA_PREMULT")
        self._engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, (0, 0), context.region.width, context.region.height)
        self._engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def _say(self, text: str) -> None:
        self._engine.update_stats("", text)


def _texture_of(pixels: np.ndarray) -> Any:
    height, width, _ = pixels.shape
    buffer = gpu.types.Buffer("FLOAT", pixels.size, pixels.ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
