"""Interactive views of scenes in memory."""

from __future__ import annotations

import json
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import FarmError, SceneError
from ._farm import Farm
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


@dataclass(frozen=True)
class ViewportMachine:
    """A machine of a farm that renders samples for a viewport."""

    name: str
    """The name of its process."""
    samples_per_second: float
    """Samples of pixels per second, over the last seconds."""
    bytes_per_second: float
    """Bytes per second that it sends, over the last seconds."""
    refused: str | None = None
    """The reason why it does not help."""


class Viewport:
    """An interactive view of a scene: frames of linear light that become finer while other threads render.

    >>> with bottega.Viewport(scene, size=(640, 480)) as viewport:
    ...     pixels = np.empty((480, 640, 4), np.float32)
    ...     while viewport.wait(1.0):
    ...         frame = viewport.frame_into(pixels)

    - `size`: columns and rows of the picture.
    - `camera`: key of a camera of the scene, or a `Camera`; `None`: the first of the scene.
    - `region`: x0, y0, x1, y1, the part of the picture that is rendered, with row 0 on top; `None`: all. Frames have its size.
    - `farm`: a farm whose free machines render samples of the view, too; `None`: this process alone. Each machine that helps has
      the scene loaded; where nobody helps, the viewport is as without a farm.
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
        farm: Farm | None = None,
        **fields: Any,
    ) -> None:
        if not isinstance(scene, Scene):
            raise SceneError(f"`scene` is a {type(scene).__name__}: make a bottega.Scene, or read one by bottega.Scene.read")
        self._scene = scene
        self._request = Request.of("a scene in memory", **fields)
        linked = farm._native if isinstance(farm, Farm) else None
        if farm is not None and not isinstance(linked, _native.Farm):
            raise FarmError("no machine renders samples for a viewport by HTTP", "use the address bottega://WORD@HOST:PORT")
        self._native = _native.Viewport(scene._native, self._request.to_json(), linked if isinstance(linked, _native.Farm) else None)
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

    @property
    def machines(self) -> list[ViewportMachine]:
        """The machines of the farm that render samples, and those that cannot, by name; empty without a farm."""
        return [ViewportMachine(**machine) for machine in self._native.machines()]

    @property
    def farm_problem(self) -> str | None:
        """Why no machine of the farm helps, if the scene cannot be sent to them."""
        return self._native.farm_problem()

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
