"""A farm of machines."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterator

from . import _native
from ._api import OnEvent, OnProgress, SceneLike, _both, request_of
from ._errors import FarmError, RequestError

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._requests import Fields

_LOOK_EVERY = 0.25


class Farm:
    """A farm to which this process is linked.

    - `address`: as `bottega up` prints it, `bottega://WORD@HOST:PORT`; `None`: the farm that runs on this machine.
    - `creds`, `nkey`, `tls_ca`, `tls_own` (certificate, key): files, for NATS servers that others run.

    Raises `FarmError` where there is no such farm.
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
        """Asks for a picture, and does not wait for it. `output` names the file that the picture is called by."""
        return Job(self, self._native.submit(_asked(scene, fields), on_event))

    def render(
        self,
        scene: SceneLike,
        *,
        on_event: OnEvent | None = None,
        on_progress: OnProgress | None = None,
        **fields: Unpack[Fields],
    ) -> Path:
        """Asks for a picture and paints with the others. Returns the file that it is written to, which `output` names."""
        return self._native.render(_asked(scene, fields), _both(on_event, on_progress))

    def jobs(self) -> list[Job]:
        """All jobs, by number."""
        return [Job(self, view["job"]) for view in self._native.jobs()]

    def job(self, number: int) -> Job:
        """A job by its number. Raises `FarmError` where there is none."""
        job = Job(self, number)
        job.view()
        return job

    def machines(self) -> list[dict[str, Any]]:
        """The machines that are there: `machine`, `state`, `ordered`, `activity`, `threads`, `job`, `version`, `takes_orders`."""
        return self._native.machines()


class Job:
    """A job of a farm."""

    def __init__(self, farm: Farm, number: int) -> None:
        self._native = farm._native
        self.number = number
        """Its number at the farm."""

    def view(self) -> dict[str, Any]:
        """How it stands: `job`, `state` (active, paused, done, failed, cancelled), `reason`, `done` (0 to 1), `zones_done`, `zones`,
        `priority`, `machines`, `leader`, `from`, `submitted`, `scene`, `output`, `kept`.
        """
        for view in self._native.jobs():
            if view["job"] == self.number:
                return view
        raise FarmError(f"there is no job {self.number}", "farm.jobs() has those that are there")

    def watch(self) -> Iterator[dict[str, Any]]:
        """How it stands, again whenever that has changed, until it is over."""
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
        """Waits until it is over, and says how it stands. Raises `TimeoutError` after so many seconds."""
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            view = self.view()
            if view["state"] not in ("active", "paused"):
                return view
            if end is not None and time.monotonic() > end:
                raise TimeoutError(f"job {self.number} is {view['state']} after {timeout} s")
            time.sleep(_LOOK_EVERY)

    def fetch(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Writes its picture; `None`: to the file that `output` named. Raises `FarmError` where the farm has none."""
        return self._native.fetch(self.number, path)

    def log(self) -> list[dict[str, Any]]:
        """What has happened to it: `at` (seconds since 1970) and `text`."""
        return self._native.log(self.number)

    def pause(self) -> None:
        """Has nobody paint it until it is resumed. What is painted is kept."""
        self._native.pause(self.number)

    def resume(self) -> None:
        """Goes on with it."""
        self._native.resume(self.number)

    def cancel(self) -> None:
        """Calls it off."""
        self._native.cancel(self.number)

    def remove(self) -> None:
        """Forgets it, once it is over."""
        self._native.remove(self.number)

    def __repr__(self) -> str:
        return f"<bottega.Job {self.number}>"


def _asked(scene: SceneLike, fields: Fields) -> str:
    if isinstance(scene, _native.Scene):
        raise RequestError("a scene in memory cannot be sent to a farm", "write it to a file, and name that")
    return request_of(scene, fields).to_json()
