"""Farms of machines, and their jobs."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterator

from . import _native
from ._api import LivePicture, OnEvent, OnProgress, SceneLike, _both, request_of
from ._errors import FarmError, SceneError
from ._scene import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._requests import Fields

_LOOK_EVERY = 0.25


class Farm:
    """A farm to which this process is linked.

    - `address`: as `bottega up` prints it, `bottega://WORD@HOST:PORT`; `None`: the farm that runs on this machine.
    - `creds`, `nkey`, `tls_ca`, `tls_own` (certificate, key): files with credentials, for NATS servers run by others.

    Raises `FarmError` if the farm cannot be reached.
    """

    def __init__(
        self,
        address: str | None = None,
        *,
        creds: str | os.PathLike[str] | None = None,
        nkey: str | os.PathLike[str] | None = None,
        tls_ca: str | os.PathLike[str] | None = None,
        tls_own: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None = None,
    ) -> None:
        self._native = _native.Farm(address, creds=creds, nkey=nkey, tls_ca=tls_ca, tls_own=tls_own)

    def submit(self, scene: SceneLike, *, on_event: OnEvent | None = None, **fields: Unpack[Fields]) -> Job:
        """Submits a picture, and does not wait for it. `output` gives the file name of the picture. Returns the job.

        A scene in memory is sent as it is now; meshes and images that the farm has from an earlier picture are not sent again.
        """
        with _in_file(scene) as named:
            return Job(self, self._native.submit(request_of(named, fields).to_json(), on_event))

    def session(self, scene: SceneLike, *, live: bool = False, **fields: Unpack[Fields]) -> FarmSession:
        """Opens a session whose picture is rendered with the machines of the farm. `live`: see `Session`."""
        return FarmSession(self, scene, live, fields)

    def render(
        self,
        scene: SceneLike,
        *,
        on_event: OnEvent | None = None,
        on_progress: OnProgress | None = None,
        **fields: Unpack[Fields],
    ) -> Path:
        """Submits a picture, takes part in rendering it, and waits for it. Returns the file that `output` names."""
        return self.session(scene, **fields).render(on_event, on_progress)

    def jobs(self) -> list[Job]:
        """Returns all jobs, in the order of their numbers."""
        return [Job(self, view["job"]) for view in self._native.jobs()]

    def job(self, number: int) -> Job:
        """Returns a job by its number. Raises `FarmError` if there is none."""
        job = Job(self, number)
        job.view()
        return job

    def machines(self) -> list[dict[str, Any]]:
        """Returns the machines that are present: `machine`, `state`, `ordered`, `activity`, `threads`, `job`, `version`, `takes_orders`."""
        return self._native.machines()


class Job:
    """A job of a farm."""

    def __init__(self, farm: Farm, number: int) -> None:
        self._native = farm._native
        self.number = number
        """Number of the job on the farm."""

    def view(self) -> dict[str, Any]:
        """Returns the state of the job: `job`, `state` (active, paused, done, failed, cancelled), `reason`, `done` (0 to 1), `zones_done`,
        `zones`, `priority`, `machines`, `leader`, `from`, `submitted`, `scene`, `output`, `kept`.
        """
        for view in self._native.jobs():
            if view["job"] == self.number:
                return view
        raise FarmError(f"there is no job {self.number}", "farm.jobs() has those that are there")

    def watch(self) -> Iterator[dict[str, Any]]:
        """Yields the state of the job (see `view`) now and after each change, until the job is over."""
        last: dict[str, Any] | None = None
        while True:
            view = self.view()
            if view != last:
                yield view
                last = view
            if view["state"] not in ("active", "paused"):
                return
            time.sleep(_LOOK_EVERY)

    def wait(self, timeout: float | None = None) -> dict[str, Any]:
        """Waits until the job is over, and returns its state (see `view`). Raises `TimeoutError` after `timeout` seconds."""
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            view = self.view()
            if view["state"] not in ("active", "paused"):
                return view
            if end is not None and time.monotonic() > end:
                raise TimeoutError(f"job {self.number} is {view['state']} after {timeout} s")
            time.sleep(_LOOK_EVERY)

    def fetch(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Writes the picture to `path`; `None`: to the file that `output` named. Returns the file. Raises `FarmError` if there is none."""
        return self._native.fetch(self.number, path)

    def log(self) -> list[dict[str, Any]]:
        """Returns the log of the job, oldest line first: `at` (seconds since 1970) and `text`."""
        return self._native.log(self.number)

    def pause(self) -> None:
        """Pauses the job until it is resumed. Finished zones are kept."""
        self._native.pause(self.number)

    def resume(self) -> None:
        """Resumes the paused job."""
        self._native.resume(self.number)

    def cancel(self) -> None:
        """Cancels the job."""
        self._native.cancel(self.number)

    def remove(self) -> None:
        """Removes the job and its picture from the farm. The job must be over."""
        self._native.remove(self.number)

    def __repr__(self) -> str:
        return f"<bottega.Job {self.number}>"


class FarmSession(LivePicture):
    """A picture of a loaded scene, to be rendered once with the machines of a farm. `Farm.session` opens it.

    `render` may run in another thread; `stop`, `layers` and `preview` may be called from any thread.
    """

    def __init__(self, farm: Farm, scene: SceneLike, live: bool, fields: Fields) -> None:
        with contextlib.ExitStack() as kept:
            request = request_of(kept.enter_context(_in_file(scene)), fields)
            if request.output.file is None:
                raise FarmError(
                    "a farm writes its picture to a file, and the request names none",
                    'output="picture.exr"; `bottega.read` has the pixels then',
                )
            self.request = request
            """The request of the picture."""
            self._native = _native.Session(request.to_json(), farm=farm._native, live=live)
            self._file = kept.pop_all()

    def render(self, on_event: OnEvent | None = None, on_progress: OnProgress | None = None) -> Path:
        """Submits the picture, takes part in rendering it, and waits for it. Returns the file that `output` names. Callbacks: see
        `Session.render`. After `stop` the job is cancelled, and the file has the picture painted so far.
        """
        with self._file:
            return self._native.render_with_farm(_both(on_event, on_progress))


@contextlib.contextmanager
def _in_file(scene: SceneLike) -> Iterator[SceneLike]:
    """Gives a scene that is in a file: one in memory is saved for the time being."""
    if not isinstance(scene, Scene):
        yield scene
        return
    if len(scene.cameras) == 0:
        raise SceneError('the scene has no camera: scene.cameras["main"] = bottega.Camera.looking(eye=(0, 1, 5), target=(0, 0, 0))')
    with tempfile.TemporaryDirectory(prefix="bottega-") as folder:
        file = Path(folder) / "scene.bottega"
        scene.save(file)
        yield file
