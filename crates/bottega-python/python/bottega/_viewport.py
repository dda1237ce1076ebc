"""Interactive views of scenes in memory."""

from __future__ import annotations

import json
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import SceneError
from ._lights import Camera
from ._requests import Request
from ._scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Frame:
    """A frame that was copied."""

    number: int
    """Number of the frame; grows with each change of the pixels."""
    look: int
    """Number of the look that it shows: 0 at first, then what `update` and `look` have returned."""
    samples: int
    """Samples that each pixel has at least; 0: a coarse frame."""
    is_denoised: bool
    """True if it is denoised."""


class Viewport:
    """An interactive view of a scene: frames of linear light that become finer while other threads render.

    >>> with bottega.Viewport(scene, size=(640, 480)) as viewport:
    ...     pixels = np.empty((480, 640, 4), np.float32)
    ...     while viewport.wait(1.0):
    ...         frame = viewport.frame_into(pixels)

    - `size`: columns and rows of the picture.
    - `camera`: key of a camera of the scene, or a `Camera`; `None`: the first of the scene.
    - `region`: x0, y0, x1, y1, the part of the picture that is rendered, with row 0 on top; `None`: all. Frames have its size.
    - `fields`: fields of the request, such as `spp=64` (samples after which it rests), `denoise=True`, `max_depth=8`.

    Edits of the scene are shown by `update`, all of them at once.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        size: tuple[int, int] = (640, 480),
        camera: str | Camera | None = None,
        region: tuple[int, int, int, int] | None = None,
        **fields: Any,
    ) -> None:
        if not isinstance(scene, Scene):
            raise SceneError(f"`scene` is a {type(scene).__name__}: make a bottega.Scene, or read one by bottega.Scene.read")
        self._scene = scene
        self._request = Request.of("a scene in memory", **fields)
        self._native = _native.Viewport(scene._native, self._request.to_json())
        # A viewport that nobody holds, and one that runs at the end of the interpreter, stops.
        self._finalizer = weakref.finalize(self, self._native.stop)
        self.look(size=size, camera=camera, region=region)

    def start(self) -> None:
        """Starts rendering the scene as it is now. Raises `SceneError` and `RequestError`."""
        self._native.start()

    def stop(self) -> None:
        """Ends rendering, without waiting for the step that is running. `start` begins again."""
        self._native.stop()

    @property
    def is_running(self) -> bool:
        """True if the viewport has started and was not stopped."""
        return self._native.is_running()

    def update(self) -> int | None:
        """Shows the scene as it is now. Returns the number of the new look; `None`: the viewport does not run.

        Only what has changed is prepared again: cameras are exchanged, other materials, lights and environments keep the acceleration
        structure, and where objects have only moved it is refitted.
        """
        return self._native.update()

    def look(
        self,
        *,
        size: tuple[int, int] | None = None,
        camera: str | Camera | None = None,
        region: tuple[int, int, int, int] | None = None,
    ) -> int | None:
        """Changes the view; the scene is shown as it is now. Returns the number of the new look; `None`: the viewport does not run.

        `size`: `None` keeps it. `camera` and `region` are as in the constructor.
        """
        request = self._request.changed(crop=region)
        if size is not None:
            request.film.size = size
        request.view.camera = camera if isinstance(camera, str) else None
        view: Any = camera.plain_fields(self._scene._native) if isinstance(camera, Camera) else None
        look = self._native.look(request.to_json(), json.dumps(view))
        self._request = request
        return look

    @property
    def shape(self) -> tuple[int, int, int]:
        """The shape of the array for `frame_into`: (height, width, 4)."""
        width, height = self._request.film.size or (0, 0)
        if self._request.film.crop is not None:
            x0, y0, x1, y1 = self._request.film.crop
            width, height = x1 - x0, y1 - y0
        return height, width, 4

    def wait(self, seconds: float) -> bool:
        """Waits until there is a frame that was not copied yet. Returns false after `seconds`, or if the viewport does not run."""
        return self._native.wait(seconds)

    def frame_into(self, array: NDArray[np.float32]) -> Frame | None:
        """Copies the current frame into an array: float32, `shape`, contiguous; linear R G B A, the lowest row first.

        Returns `None` if there is no frame of this size yet; the array is then as before.
        """
        copied = self._native.frame_into(array)
        return None if copied is None else Frame(*copied)

    def __enter__(self) -> Viewport:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
