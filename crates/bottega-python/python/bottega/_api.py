"""Sessions, and functions for a single call: `render`, `analyze`, `diff`."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Union

from . import _native
from ._native import Analysis, ImageFile, Picture
from ._requests import Request
from ._scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._requests import Fields

Event = dict[str, Any]
OnEvent = Callable[[Event], object]
OnProgress = Callable[["Progress"], object]
SceneLike = Union[str, "os.PathLike[str]", Request, Scene]
PictureLike = Union[Picture, ImageFile, "ArrayLike", str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Progress:
    """The progress of a picture. For tqdm: `bar.update(progress.fraction - bar.n)` of a bar with `total=1`."""

    fraction: float
    """Share of the predicted work that is done, 0 to 1."""
    done: int
    """Samples taken so far, over all pixels."""
    total: int
    """Samples of the complete picture, over all pixels; with an error or a time the maximum."""
    seconds: float
    """Seconds since rendering began."""
    seconds_left: float | None
    """Estimated seconds left; `None`: unknown."""


class LivePicture:
    """A picture that is rendered, seen from any thread."""

    _native: _native.Session

    def stop(self) -> None:
        """Requests that rendering stops; it ends within some hundredths of a second."""
        self._native.stop()

    def layers(self) -> dict[str, NDArray[np.float32]] | None:
        """Returns copies of the layers painted so far, by name: float32, linear light, row 0 on top, shapes as of a `Picture`'s; 0 where
        nothing is painted. `None`: nothing is painted yet. Needs `live`."""
        return self._native.layers()

    def preview(self) -> NDArray[np.uint8] | None:
        """Returns the latest preview: uint8, (height, width, 3), sRGB; `None`: there is none yet. Needs `live`."""
        return self._native.preview()

    def preview_png(self) -> bytes | None:
        """Returns the latest preview as the bytes of a PNG file; `None`: there is none yet. Needs `live`."""
        return self._native.preview_png()


class Session(LivePicture):
    """A loaded scene, to be rendered once.

    Opening a session reads the scene and checks the request, so errors are raised before the first sample. `render` may run in another
    thread; `stop`, `layers` and `preview` may be called from any thread.

    - `live`: keep previews and layers during rendering, for `preview` and `layers`; takes at most 1 % of the time.
    - `resume`: resume from the journal that an earlier session has left beside `output`.
    - `preview`: a PNG file that is updated with a preview during rendering.
    - `record`: a file for the times of zones, for `bottega simulate`.
    - `timeline`: an SVG or JSON file for the timeline of processors and devices.
    """

    def __init__(
        self,
        scene: SceneLike,
        *,
        live: bool = False,
        resume: bool = False,
        preview: str | os.PathLike[str] | None = None,
        record: str | os.PathLike[str] | None = None,
        timeline: str | os.PathLike[str] | None = None,
        **fields: Unpack[Fields],
    ) -> None:
        self.request = request_of(scene, fields)
        """The request of the picture."""
        made = scene._native if isinstance(scene, Scene) else None
        options = {"live": live, "resume": resume, "preview": preview, "record": record, "timeline": timeline}
        self._native = _native.Session(self.request.to_json(), made, **options)  # type: ignore[arg-type]

    def render(self, on_event: OnEvent | None = None, on_progress: OnProgress | None = None) -> Picture:
        """Renders the picture and waits for it, without the interpreter's lock.

        Callbacks run in the calling thread. An exception of a callback stops rendering and is raised by this call. `on_event` gets every
        event as a dictionary, as `bottega render --json` prints them; `on_progress` gets the progress twice a second, and last with
        `fraction` 1.

        Raises `Interrupted` (a `KeyboardInterrupt`) at Ctrl-C; its `picture` is the picture painted so far. A second Ctrl-C does not
        wait for that. After `stop` the partial picture is returned; `picture.is_whole` is then false.
        """
        return self._native.render(_both(on_event, on_progress))


def render(
    scene: SceneLike,
    *,
    on_event: OnEvent | None = None,
    on_progress: OnProgress | None = None,
    **fields: Unpack[Fields],
) -> Picture:
    """Renders a picture.

    - `scene`: a file, a `Scene` in memory, or a `Request`.
    - `fields`: fields of the request, such as `spp=64`, `size=(640, 480)`, `denoise=True`, `output="picture.exr"`, or a section:
      `goal={"error": 0.02}`.
    - `on_event`, `on_progress`: see `Session.render`.

    Raises `RequestError`, `SceneError` and the other errors of this module; `Interrupted` at Ctrl-C, with the picture painted so far.
    """
    # Warnings are reported for the caller of this function.
    return Session(scene, **fields)._native.render(_both(on_event, on_progress), 3)


def analyze(scene: SceneLike, **fields: Unpack[Fields]) -> Analysis:
    """Returns the Analyst's view of a scene, without rendering it: the importance map and the zones.

    The section `work` sets the division into zones: `analyze("scene.glb", work={"level": 2, "importance": "visual"}, agents=8)`.
    """
    made = scene._native if isinstance(scene, Scene) else None
    return _native.analyze(request_of(scene, fields).to_json(), made)


def diff(picture: PictureLike, reference: PictureLike) -> dict[str, Any]:
    """Compares two pictures, as `bottega diff` does. Returns a dictionary: `rmse`, `mae`, `rel_mse`, `rel_mse_trimmed`, `flip`,
    `flip_visible_share`, `mean_ratio`, and `flip_map`, float32, (height, width).

    Each picture is a `Picture`, a file, or an array of linear light, (height, width, 3). Raises `ValueError` if they differ in size.
    """
    return _native.diff(_pixels(picture), _pixels(reference))


def request_of(scene: SceneLike, fields: Fields) -> Request:
    """Returns the request for the arguments of `render`."""
    if isinstance(scene, Request):
        return scene.changed(**fields)
    return Request.of("a scene in memory" if isinstance(scene, Scene) else scene, **fields)


def _pixels(picture: PictureLike) -> ArrayLike:
    if isinstance(picture, (str, os.PathLike)):
        return _native.read(picture).color
    return picture.color if isinstance(picture, (Picture, ImageFile)) else picture


def _both(on_event: OnEvent | None, on_progress: OnProgress | None) -> OnEvent | None:
    """Combines the callbacks for events and progress into one for events."""
    if on_progress is None:
        return on_event
    last = Progress(0.0, 0, 0, 0.0, None)

    def forward(event: Event) -> None:
        nonlocal last
        if event["event"] == "progress":
            last = Progress(
                event["share"], event["samples_done"], event["samples"], event["seconds"], event.get("seconds_left")
            )
            on_progress(last)
        elif event["event"] == "finished":
            on_progress(Progress(1.0, event["samples"], event["samples"], event["seconds"], 0.0))
        if on_event is not None:
            on_event(event)

    return forward
