"""Sessions, and what is done with one call."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Union

from . import _native
from ._native import Analysis, ImageFile, Picture, Scene
from ._requests import Request

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
    """How far a picture is. For tqdm: `bar.update(progress.fraction - bar.n)` of a bar with `total=1`."""

    fraction: float
    """Share of the predicted work that is done, 0 to 1."""
    done: int
    """Samples taken, all pixels together."""
    total: int
    """Samples that the picture will have; with an error or a time the most that it may have."""
    seconds: float
    """Since rendering began."""
    seconds_left: float | None
    """Still to go; `None` where nothing is known yet."""


class Session:
    """A scene that is loaded, and painted once.

    Opening it reads the scene and finds out everything that can be wrong, before the first sample. `render` may run in another thread;
    `stop` and `preview` are called from any.

    - `live`: make previews while it is painted, for `preview`; at most one part in a hundred of the time.
    - `resume`: go on with what an earlier session has left beside `output`.
    - `preview`: a PNG file that shows the picture while it is painted.
    - `record`: a file for what each zone took, for `bottega simulate`.
    - `timeline`: an SVG or JSON file for what processors and devices were at.
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
        """What is painted."""
        made = scene if isinstance(scene, Scene) else None
        options = {"live": live, "resume": resume, "preview": preview, "record": record, "timeline": timeline}
        self._native = _native.Session(self.request.to_json(), made, **options)  # type: ignore[arg-type]

    def render(self, on_event: OnEvent | None = None, on_progress: OnProgress | None = None) -> Picture:
        """Paints the picture and waits for it, without the interpreter's lock.

        Callbacks run in the thread that calls. What they raise stops the painting and comes out of here. `on_event` has every event as a
        dictionary, as `bottega render --json` prints them; `on_progress` has progress twice a second, and last with `fraction` 1.

        Raises `Interrupted` (a `KeyboardInterrupt`) at Ctrl-C, with what is painted as its `picture`; a second Ctrl-C does not wait
        for it. After `stop` it returns what is painted; `picture.is_whole` tells.
        """
        return self._native.render(_both(on_event, on_progress))

    def stop(self) -> None:
        """Asks the painting to stop; it ends within some hundredths of a second."""
        self._native.stop()

    def preview(self) -> NDArray[np.uint8] | None:
        """The picture as it is now: uint8, (height, width, 3), sRGB. `None` before the first look; only with `live`."""
        return self._native.preview()

    def preview_png(self) -> bytes | None:
        """The same as the bytes of a PNG file."""
        return self._native.preview_png()


def render(
    scene: SceneLike,
    *,
    on_event: OnEvent | None = None,
    on_progress: OnProgress | None = None,
    **fields: Unpack[Fields],
) -> Picture:
    """Paints a picture.

    - `scene`: a file, a `Scene` of arrays, or a `Request`.
    - `fields`: fields of the request, such as `spp=64`, `size=(640, 480)`, `denoise=True`, `output="picture.exr"`, or a section:
      `goal={"error": 0.02}`.
    - `on_event`, `on_progress`: see `Session.render`.

    Raises `RequestError`, `SceneError` and the other errors of this module; `Interrupted` at Ctrl-C, with what is painted.
    """
    # A warning is shown where this was called.
    return Session(scene, **fields)._native.render(_both(on_event, on_progress), 3)


def analyze(scene: SceneLike, **fields: Unpack[Fields]) -> Analysis:
    """What the Analyst makes of a scene before anything is painted: the importance map, and the zones.

    How it is cut is asked for by `work`: `analyze("scene.glb", work={"level": 2, "importance": "visual"}, agents=8)`.
    """
    made = scene if isinstance(scene, Scene) else None
    return _native.analyze(request_of(scene, fields).to_json(), made)


def diff(picture: PictureLike, reference: PictureLike) -> dict[str, Any]:
    """How two pictures differ, as `bottega diff` tells: `rmse`, `mae`, `rel_mse`, `rel_mse_trimmed`, `flip`, `flip_visible_share`,
    `mean_ratio`, and `flip_map`, float32, (height, width).

    Each is a `Picture`, a file, or an array of linear light, (height, width, 3). Raises `ValueError` where they differ in size.
    """
    return _native.diff(_pixels(picture), _pixels(reference))


def request_of(scene: SceneLike, fields: Fields) -> Request:
    """The request of what `render` takes."""
    if isinstance(scene, Request):
        return scene.changed(**fields)
    return Request.of("a scene in memory" if isinstance(scene, Scene) else scene, **fields)


def _pixels(picture: PictureLike) -> ArrayLike:
    if isinstance(picture, (str, os.PathLike)):
        return _native.read(picture).color
    return picture.color if isinstance(picture, (Picture, ImageFile)) else picture


def _both(on_event: OnEvent | None, on_progress: OnProgress | None) -> OnEvent | None:
    """One callback for events and progress."""
    if on_progress is None:
        return on_event
    last = Progress(0.0, 0, 0, 0.0, None)

    def told(event: Event) -> None:
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

    return told
