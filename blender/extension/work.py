# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture that is rendered: by this machine, or by all machines of a farm."""

from __future__ import annotations

import contextlib
import tempfile
import time
from pathlib import Path
from typing import Any

import bottega

from . import farm
from .final import Layers

# Seconds between two questions to the farm for the machines of the picture.
ASK_EVERY = 2.0


class Work:
    """A picture that this machine renders.

    `progress`: the latest, `None` at first. `warnings`: of a farm, such as machines that it leaves out, and why. `render` runs in a thread of its own; the rest may be called meanwhile.
    """

    def __init__(self, made: bottega.Scene, fields: dict[str, Any]) -> None:
        self.progress: bottega.Progress | None = None
        self.warnings: list[str] = []
        self._session: Any = self._open(made, fields)

    def _open(self, made: bottega.Scene, fields: dict[str, Any]) -> Any:
        return bottega.Session(made, live=True, camera="camera", **fields)

    def render(self) -> Layers:
        """Renders the picture and returns its layers."""
        return self._session.render(on_progress=self._note)

    def _note(self, progress: bottega.Progress) -> None:
        self.progress = progress

    def stop(self) -> None:
        """Requests that rendering stops."""
        self._session.stop()

    def layers(self) -> Layers | None:
        """Returns the layers painted so far; `None`: nothing is painted."""
        return self._session.layers()

    def state(self) -> str:
        """Returns the text beside the progress; may be empty."""
        return ""

    def end(self) -> None:
        """Removes what was kept for the picture. Its layers cannot be read afterwards."""


class FarmWork(Work):
    """A picture that all machines of a farm render, this one among them."""

    def _open(self, made: bottega.Scene, fields: dict[str, Any]) -> Any:
        self._folder = tempfile.TemporaryDirectory(prefix="bottega-picture-")
        self._farm = bottega.Farm(farm.address())
        self._job: int | None = None
        self._sent = ""
        self._machines, self._next = 0, 0.0
        output = Path(self._folder.name) / "picture.exr"
        return self._farm.session(made, live=True, camera="camera", output=str(output), **fields)

    def render(self) -> Layers:
        return bottega.read(self._session.render(on_event=self._hear, on_progress=self._note))

    def _hear(self, event: dict[str, Any]) -> None:
        if event["event"] == "sending":
            self._sent = f"{event['bytes_sent'] / 1e6:.0f} of {event['bytes'] / 1e6:.0f} MB sent"
        elif event["event"] == "asked":
            self._job, self._sent = event["job"], ""
            farm.own_jobs.add(event["job"])
        elif event["event"] == "warning":
            self.warnings.append(event["message"])

    def state(self) -> str:
        if self._job is not None and time.monotonic() > self._next:
            self._next = time.monotonic() + ASK_EVERY
            # A farm that is out of reach for a moment does not end the picture.
            with contextlib.suppress(bottega.FarmError):
                self._machines = sum(machine["job"] == self._job for machine in self._farm.machines())
        count = self._machines
        return self._sent or ("" if count == 0 else f"{count} machine{'s' if count > 1 else ''}")

    def end(self) -> None:
        farm.own_jobs.discard(self._job)
        self._folder.cleanup()


def work_for(settings: Any, made: bottega.Scene, fields: dict[str, Any]) -> Work:
    """Opens a picture where the settings of the scene say. Raises the errors of `bottega`."""
    return FarmWork(made, fields) if settings.use_farm else Work(made, fields)
