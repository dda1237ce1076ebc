"""A farm by its HTTP API: what `Farm` and `Job` ask of it."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import ssl
import tempfile
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import FarmError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_TIMEOUT = 150.0
# Seconds after which a silent stream of events is opened again; the farm sends a sign of life every ten.
_SILENCE = 30.0
# Seconds before a stream that broke off is opened again.
_PAUSE = 1.0
# Seconds without a question after which a stream is closed.
_IDLE = 30.0


class HttpFarm:
    """The HTTP API of a farm, with the methods of the linked farm (`_native.Farm`).

    - `address`: of the page, such as `https://10.0.0.7:8443`. `token`: see `bottega tokens`; `None`: the address has it.
    - `tls_ca`: a file with the certificate of the farm, which it has signed itself.
    """

    def __init__(self, address: str, token: str | None, tls_ca: str | os.PathLike[str] | None) -> None:
        parts = urllib.parse.urlsplit(address)
        # The addresses that `bottega up` prints have their tokens.
        self._token = token or next(iter(urllib.parse.parse_qs(parts.query).get("token", [])), "")
        self._base = f"{parts.scheme}://{parts.netloc}"
        self._tls = ssl.create_default_context(cafile=None if tls_ca is None else os.fspath(tls_ca)) if parts.scheme == "https" else None
        self._outputs: dict[int, str] = {}
        self._lock = threading.Lock()
        self._events: dict[int, _JobEvents] = {}
        self._get("about")

    def submit(self, request: str, on_event: Any = None) -> int:
        """Uploads the files of a request that the farm lacks, and asks for the picture. Returns the number of the job."""
        output = json.loads(request).get("output", {}).get("file")
        request, files = _native.submission(request)
        digests = {name: self._upload(name, path, on_event) for name, path in files}
        number = self._post("jobs", {"request": json.loads(request), "files": digests})["job"]
        if output:
            self._outputs[number] = output
        return int(number)

    def _upload(self, name: str, path: Path, on_event: Any) -> str:
        size, digest, chunks = _native.digests(path)
        offer = {"name": name, "size": size, "digest": digest, "chunks": chunks}
        state = self._post("uploads", offer)
        for sent, missing in enumerate(state["missing"]):
            with open(path, "rb") as file:
                file.seek(chunks.index(missing) * state["chunk_bytes"])
                self._ask("PUT", f"uploads/chunks/{missing}", file.read(state["chunk_bytes"]), "application/octet-stream")
            if on_event is not None:
                done = min((sent + 1) * state["chunk_bytes"], size)
                on_event({"event": "sending", "bytes_sent": done, "bytes": size})
        return digest

    def jobs(self) -> list[Any]:
        return list(self._get("jobs"))

    def machines(self) -> list[Any]:
        return list(self._get("machines"))

    def log(self, number: int) -> list[dict[str, Any]]:
        return list(self._get(f"jobs/{number}/log"))

    def zones(self, number: int) -> list[dict[str, Any]]:
        return list(self._get(f"jobs/{number}/zones"))

    def fetch(self, number: int, path: str | os.PathLike[str] | None = None) -> Path:
        target = Path(path if path is not None else self._outputs.get(number) or self._get(f"jobs/{number}")["output"])
        bytes_ = self._ask("GET", f"jobs/{number}/picture")
        with tempfile.NamedTemporaryFile(dir=target.absolute().parent, prefix=f".{target.name[:32]}.", suffix=".part", delete=False) as part:
            part.write(bytes_)
        os.replace(part.name, target)
        return target

    def preview(self, number: int) -> NDArray[np.uint8] | None:
        png = self._ask("GET", f"jobs/{number}/preview.png")
        return _native.preview_array(png) if png else None

    def layers(self, number: int) -> None:
        """A farm tells layers by HTTP only of pictures that are done."""

    def pause(self, number: int) -> None:
        self._post(f"jobs/{number}/pause")

    def resume(self, number: int) -> None:
        self._post(f"jobs/{number}/resume")

    def cancel(self, number: int) -> None:
        self._post(f"jobs/{number}/cancel")

    def remove(self, number: int) -> None:
        self._ask("DELETE", f"jobs/{number}")

    def set_priority(self, number: int, priority: int) -> None:
        body = json.dumps({"priority": priority}).encode()
        self._ask("PUT", f"jobs/{number}/priority", body, "application/json")

    def requeue(self, number: int, zone: int) -> None:
        self._post(f"jobs/{number}/zones/{zone}/requeue")

    def wait(self, number: int, seen: int, seconds: float) -> int:
        """Waits until something changes in a job, at most `seconds`. Returns the number of changes. `seen`: the number returned before."""
        with self._lock:
            events = self._events.get(number)
            if events is None or not events.is_alive():
                events = self._events[number] = _JobEvents(self, number)
        return events.wait(seen, seconds)

    def stream(self, route: str) -> http.client.HTTPResponse:
        """Opens a stream of events. Raises `FarmError`."""
        answer: http.client.HTTPResponse = self._open("GET", route, timeout=_SILENCE)
        return answer

    def _get(self, route: str) -> Any:
        return json.loads(self._ask("GET", route))

    def _post(self, route: str, body: Any = None) -> Any:
        sent = b"" if body is None else json.dumps(body).encode()
        answer = self._ask("POST", route, sent, "application/json")
        return json.loads(answer) if answer else None

    def _ask(self, method: str, route: str, body: bytes | None = None, kind: str | None = None) -> bytes:
        """Sends a request and returns the body of the answer. Raises `FarmError` with the farm's own words."""
        with self._open(method, route, body, kind) as answer:
            try:
                return bytes(answer.read())
            except (OSError, http.client.HTTPException) as error:
                raise FarmError(f"{self._base} broke off: {error}", "ask again") from None

    def _open(self, method: str, route: str, body: bytes | None = None, kind: str | None = None, timeout: float = _TIMEOUT) -> Any:
        """Sends a request and returns the answer, open. Raises `FarmError` with the farm's own words."""
        request = urllib.request.Request(f"{self._base}/api/{route}", body, method=method)
        if self._token:
            request.add_header("Authorization", f"Bearer {self._token}")
        if kind is not None:
            request.add_header("Content-Type", kind)
        try:
            return urllib.request.urlopen(request, timeout=timeout, context=self._tls)
        except urllib.error.HTTPError as error:
            raise _refused(error) from None
        except ssl.SSLError as error:
            remedy = "tls_ca=FILE names the certificate of the farm"
            raise FarmError(f"{self._base} is not trusted: {error.reason}", remedy) from None
        except (urllib.error.URLError, OSError) as error:
            reason = getattr(error, "reason", error)
            if isinstance(reason, ssl.SSLError):
                raise FarmError(f"{self._base} is not trusted: {reason}", "tls_ca=FILE names the certificate of the farm") from None
            raise FarmError(f"{self._base} does not answer: {reason}", "check the address; `bottega up` prints it") from None


class _JobEvents(threading.Thread):
    """Follows the events of a job, and counts them. It ends when nobody has waited for some time."""

    def __init__(self, farm: HttpFarm, number: int) -> None:
        super().__init__(name=f"bottega job {number}", daemon=True)
        self._farm, self._number = farm, number
        self._changed = threading.Condition()
        self._count = 0
        self._last_wait = time.monotonic()
        self.start()

    def wait(self, seen: int, seconds: float) -> int:
        """Waits until the number of events is not `seen`, at most `seconds`. Returns the number."""
        self._last_wait = time.monotonic()
        with self._changed:
            self._changed.wait_for(lambda: self._count != seen, max(seconds, 0.0))
            return self._count

    def run(self) -> None:
        while not self._is_idle():
            # Try again if the farm does not answer for a moment; callers that request the state get the error.
            with contextlib.suppress(FarmError, OSError, http.client.HTTPException), self._farm.stream(f"jobs/{self._number}/events") as answer:
                for line in answer:
                    if line.startswith(b"data:"):
                        self._note()
                    if self._is_idle():
                        return
            # The job may be over, or gone.
            self._note()
            time.sleep(_PAUSE)

    def _is_idle(self) -> bool:
        return time.monotonic() - self._last_wait > _IDLE

    def _note(self) -> None:
        with self._changed:
            self._count += 1
            self._changed.notify_all()


def _refused(error: urllib.error.HTTPError) -> FarmError:
    try:
        problem = json.loads(error.read())
        return FarmError(str(problem.get("detail") or problem.get("title")), problem.get("remedy"))
    except (ValueError, AttributeError):
        return FarmError(f"the farm answers {error.code} {error.reason}")
