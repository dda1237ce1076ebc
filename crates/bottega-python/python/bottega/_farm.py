"""Farms of machines, and their jobs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterator, Literal, TypedDict

from . import _native
from ._api import LivePicture, OnEvent, OnProgress, SceneLike, _both, request_of
from ._errors import FarmError, SceneError
from ._http_farm import HttpFarm
from ._scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from ._requests import Fields

# Seconds between checks while the farm reports no change. A server may lose its last reports.
_REMINDED = 5.0


class JobView(TypedDict):
    """The state of a job."""

    job: int
    """Its number."""
    state: Literal["active", "paused", "done", "failed", "cancelled"]
    reason: str | None
    """Why it has failed."""
    done: float
    """Share of the work that is done, 0 to 1."""
    zones_done: int
    zones: int
    seconds_left: float | None
    """Estimated seconds left; `None`: unknown."""
    priority: int
    machines: int
    """Number of machines that work on it."""
    leader: str | None
    """The machine that leads it."""
    submitted: float
    """Seconds since 1970."""
    scene: str
    output: str
    """File name of the picture."""
    kept: bool
    """True if the farm has the picture."""


class MachineView(TypedDict):
    """The state of a machine."""

    machine: str
    """Its name."""
    state: str
    ordered: str
    """The state that it was ordered to take."""
    activity: str
    threads: int
    devices: list[str]
    job: int | None
    """The job that it works on."""
    version: str
    takes_orders: bool
    tags: list[str]


@dataclass(frozen=True)
class FoundFarm:
    """A farm on the local network."""

    host: str
    """The name of the machine that runs its server."""
    address: str
    """The address and port of its server."""
    pin: str
    """The digest of its server's certificate, which its word ends with."""


def farms(seconds: float = 2.0) -> list[FoundFarm]:
    """Returns the farms that announce themselves on the local network (mDNS) within some seconds, sorted by host.

    Joining one needs its word, which it does not announce: `Farm("WORD")` finds the farm of that word.
    Raises `FarmError` if the network cannot be searched.
    """
    return [FoundFarm(**farm) for farm in _native.farms(seconds)]


class Farm:
    """A farm to which this process is linked.

    - `address`: as `bottega up` prints it, `bottega://WORD@HOST:PORT`, or the word alone, whose farm is searched on the local network;
      `None`: the farm that runs on this machine. Or the address of its
      page, `https://HOST:PORT`, with a `token`: then all but `session` and `render` works by HTTP.
    - `creds`, `nkey`, `tls_ca`, `tls_own` (certificate, key): files with credentials, for NATS servers run by others.

    Raises `FarmError` if the farm cannot be reached.
    """

    def __init__(
        self,
        address: str | None = None,
        *,
        token: str | None = None,
        creds: str | os.PathLike[str] | None = None,
        nkey: str | os.PathLike[str] | None = None,
        tls_ca: str | os.PathLike[str] | None = None,
        tls_own: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None = None,
    ) -> None:
        self._native: _native.Farm | HttpFarm
        if address is not None and address.startswith(("http://", "https://")):
            self._native = HttpFarm(address, token, tls_ca)
        else:
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

    def views(self) -> list[JobView]:
        """Returns the states of all jobs, in the order of their numbers."""
        views: list[JobView] = self._native.jobs()
        return views

    def job(self, number: int) -> Job:
        """Returns a job by its number. Raises `FarmError` if there is none."""
        job = Job(self, number)
        job.view()
        return job

    def machines(self) -> list[MachineView]:
        """Returns the machines that are present."""
        return self._native.machines()


class Job:
    """A job of a farm."""

    def __init__(self, farm: Farm, number: int) -> None:
        self._native = farm._native
        self.number = number
        """Number of the job on the farm."""

    def view(self) -> JobView:
        """Returns the state of the job."""
        views: list[JobView] = self._native.jobs()
        for view in views:
            if view["job"] == self.number:
                return view
        raise FarmError(f"there is no job {self.number}", "farm.jobs() lists the jobs")

    def _wait(self, changes: int, seconds: float) -> int:
        """Waits until something changes, at most `seconds`. Returns the number of changes. `changes`: the number returned before."""
        if isinstance(self._native, HttpFarm):
            return self._native.wait(self.number, changes, seconds)
        return self._native.wait(changes, seconds)

    def watch(self) -> JobWatch:
        """Iterates over the state of the job, now and after each change, until the job is over: `for view in job.watch()`, or
        `async for view in job.watch()`, which lets other coroutines run meanwhile.
        """
        return JobWatch(self)

    def wait(self, timeout: float | None = None) -> JobView:
        """Waits until the job is over, and returns its state. Raises `TimeoutError` after `timeout` seconds."""
        end = None if timeout is None else time.monotonic() + timeout
        changes = 0
        while True:
            view = self.view()
            if not _is_going(view):
                return view
            left = _REMINDED if end is None else end - time.monotonic()
            if left <= 0.0:
                raise TimeoutError(f"job {self.number} is {view['state']} after {timeout} s")
            changes = self._wait(changes, min(left, _REMINDED))

    @property
    def priority(self) -> int:
        """The weight of the job among those that share the machines, 1 to 1000; may be set."""
        return self.view()["priority"]

    @priority.setter
    def priority(self, priority: int) -> None:
        self._native.set_priority(self.number, priority)

    def zones(self) -> list[dict[str, Any]]:
        """Returns the rows of the zones on the Blackboard, as `bottega blackboard --json` prints them."""
        return self._native.zones(self.number)

    def requeue(self, zone: int) -> None:
        """Requests that a zone that is done or has failed is painted again; of a job that is over, all of it. `zone`: its `id`."""
        self._native.requeue(self.number, zone)

    def preview(self) -> NDArray[np.uint8] | None:
        """Returns what is painted by now, tone-mapped: uint8, (height, width, 3), sRGB; coarse at first. `None`: nothing is there yet."""
        return self._native.preview(self.number)

    def layers(self) -> dict[str, NDArray[np.float32]] | None:
        """Returns copies of the layers painted so far, by name: float32, linear light, row 0 on top, shapes as of a `Picture`'s; 0 where
        nothing is painted. `None`: nothing is painted yet. Of a job that is done, the layers of its picture.
        """
        view = self.view()
        if not view["kept"]:
            return self._native.layers(self.number)
        with tempfile.TemporaryDirectory(prefix="bottega-") as folder:
            picture = _native.read(self.fetch(Path(folder) / f"picture{Path(view['output']).suffix}"))
            return {name: picture[name] for name in picture.layers}

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


class JobWatch:
    """The states of a job, one after another; see `Job.watch`."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._last: JobView | None = None
        self._changes = 0

    def __iter__(self) -> JobWatch:
        return self

    def __next__(self) -> JobView:
        view = self._next()
        if view is None:
            raise StopIteration
        return view

    def __aiter__(self) -> JobWatch:
        return self

    async def __anext__(self) -> JobView:
        view = await asyncio.get_running_loop().run_in_executor(None, self._next)
        if view is None:
            raise StopAsyncIteration
        return view

    def _next(self) -> JobView | None:
        """Waits for a state that differs from the last one; `None`: the job was over then."""
        if self._last is not None and not _is_going(self._last):
            return None
        while True:
            view = self._job.view()
            if view != self._last:
                self._last = view
                return view
            self._changes = self._job._wait(self._changes, _REMINDED)


def _is_going(view: JobView) -> bool:
    return view["state"] in ("active", "paused")


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
            if isinstance(farm._native, HttpFarm):
                raise FarmError("this machine takes no part by HTTP", "submit the picture, or use the address bottega://WORD@HOST:PORT")
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
