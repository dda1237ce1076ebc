"""The line protocol between bottega and the worker of a render engine, from the worker's side.

One JSON object a line: requests come on stdin, answers go to what was stdout when the process started. Engines print
to stdout, from C++ too, so `Line()` takes both descriptors away before any engine is imported: afterwards file
descriptor 1 is the log (stderr), and 0 is empty.

A worker is a class with `open`, `paint` and `files`, given to `serve`. What goes wrong is a `Refusal`, told in the
engine's own words, or any exception of the engine, whose text is taken as such. The protocol is told in
docs/engines.md.
"""

import hashlib
import json
import os
import queue
import sys
import threading
import time
import traceback

PROTOCOL = 1
LONGEST_LINE = 1 << 20
SECONDS_BETWEEN_PROGRESS = 0.1


class Refusal(Exception):
    """A request cannot be done. `fatal`: nothing else that is asked of this worker can be done either."""

    def __init__(self, reason, fatal=False):
        super().__init__(reason)
        self.reason = reason
        self.fatal = fatal


class Line:
    """The two ends of the protocol, taken away from the engine."""

    def __init__(self):
        sys.stdout.flush()
        self._answers = os.dup(1)
        self._requests = os.dup(0)
        os.dup2(2, 1)
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.close(nothing)
        self._lock = threading.Lock()
        # What must happen before this process ends because bottega went away, such as ending an engine's process.
        self.on_leave = lambda: None

    def watch_output(self, see):
        """Gives each line that the engine prints to stdout to `see`, as well as to the log."""
        reading, writing = os.pipe()
        os.dup2(writing, 1)
        os.close(writing)

        def pass_on():
            pending = b""
            while piece := os.read(reading, 1 << 16):
                os.write(2, piece)
                *lines, pending = (pending + piece)[-LONGEST_LINE:].split(b"\n")
                for line in lines:
                    see(line.decode(errors="replace"))
        threading.Thread(target=pass_on, daemon=True).start()

    def send(self, kind, **fields):
        text = json.dumps({kind: fields}, allow_nan=False) + "\n"
        rest = memoryview(text.encode())
        with self._lock:
            try:
                while rest:
                    rest = rest[os.write(self._answers, rest):]
            except BrokenPipeError:
                self.leave(0)

    def fail(self, reason, request=None, fatal=False):
        self.send("failed", id=request, reason=str(reason).strip() or "no reason given", fatal=fatal)

    def leave(self, code):
        """Ends at once. Destructors of engines are not run: some abort or hang there."""
        try:
            self.on_leave()
        finally:
            sys.stderr.flush()
            os._exit(code)

    def requests(self):
        """Yields the requests one after the other. The end of stdin ends the process, even while it paints."""
        waiting = queue.Queue()
        threading.Thread(target=self._read, args=(waiting,), daemon=True).start()
        while True:
            yield waiting.get()

    def _read(self, waiting):
        pending = b""
        while True:
            piece = os.read(self._requests, 1 << 16)
            if not piece:
                self.leave(0)
            pending += piece
            *lines, pending = pending.split(b"\n")
            if len(pending) > LONGEST_LINE:
                self.fail(f"a request is longer than {LONGEST_LINE} bytes", fatal=True)
                self.leave(1)
            for line in lines:
                if line.strip():
                    waiting.put(line)


def layers_of(channels, picked=(), shared=()):
    """The `layers` of the answer to `open`, of the names that the channels of a picture will have, such as `depth.Z`.

    - `picked`: layers of which a mean over passes says nothing, such as numbers of things.
    - `shared`: layers that are what bottega's own engine means by their names.
    """
    found = {}
    for name in channels:
        layer, _, channel = name.rpartition(".")
        if layer:
            found.setdefault(layer, []).append(channel)
    return [{"name": name, "channels": parts, "combine": "pick" if name in picked else "mean", "shared": name in shared}
            for name, parts in sorted(found.items())]


class Progress:
    """Tells how much of a window is painted, at most ten times a second."""

    def __init__(self, line, request):
        self._line = line
        self._request = request
        self._next = 0.0

    def __call__(self, share):
        now = time.monotonic()
        if now >= self._next:
            self._next = now + SECONDS_BETWEEN_PROGRESS
            self._line.send("progress", id=self._request, share=min(max(round(float(share), 4), 0.0), 1.0))


class Window:
    """Pixels x0 <= x < x1, y0 <= y < y1; the origin is the top left one."""

    def __init__(self, x0, y0, x1, y1):
        self.x0, self.y0, self.x1, self.y1 = int(x0), int(y0), int(x1), int(y1)

    @property
    def width(self):
        return self.x1 - self.x0

    @property
    def height(self):
        return self.y1 - self.y0

    def grown(self, margin, width, height):
        """This window with `margin` pixels more on each side, as far as the frame goes."""
        return Window(max(self.x0 - margin, 0), max(self.y0 - margin, 0), min(self.x1 + margin, width),
                      min(self.y1 + margin, height))

    def as_list(self):
        return [self.x0, self.y0, self.x1, self.y1]


class Order:
    """What a `paint` request asks for, checked."""

    def __init__(self, request, width, height):
        self.id = request["id"]
        self.window = Window(*request["window"])
        window = self.window
        if not (0 <= window.x0 < window.x1 <= width and 0 <= window.y0 < window.y1 <= height):
            raise Refusal(f"window {window.as_list()} is not within the frame of {width}x{height} pixels")
        self.samples = int(request["samples"])
        if self.samples < 1:
            raise Refusal(f"{self.samples} samples are asked for; at least 1 is needed")
        self.first_sample = int(request.get("first_sample") or 0)
        self.seed = int(request.get("seed") or 0)
        self.max_depth = optional_int(request.get("max_depth"))
        self.light_samples = optional_int(request.get("light_samples"))
        self.time = optional_int(request.get("time"))  # Seconds, for those that can end a window early.
        self.frame = optional_int(request.get("frame"))

    def hashed_seed(self, bits, *more):
        """A seed of so many bits that differs for each (seed, first_sample) and for each of `more`; never 0."""
        text = repr((self.seed, self.first_sample) + more).encode()
        number = int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "little")
        return number % ((1 << bits) - 1) + 1


def optional_int(value):
    return None if value is None else int(value)


def existing_file(path):
    """`path` itself; a refusal where there is no such file."""
    if not os.path.isfile(path):
        raise Refusal(f"{path}: no such file")
    return path


def sorted_files(paths):
    """Files in the order and form of the answer to `files`: those that are there, and those that are missing."""
    unique = sorted({os.path.abspath(path) for path in paths})
    return {"files": [path for path in unique if os.path.isfile(path)],
            "missing": [path for path in unique if not os.path.isfile(path)]}


def serve(line, worker):
    """Answers requests until stdin ends. `worker` has:

    - `name`, `version`: texts.
    - `open(request)`: loads a scene; returns the fields of `opened`. `width` and `height` are those of the frame, `layers`
      what `layers_of` makes of the channels of all its pictures.
    - `paint(order, path, progress)`: writes the pixels of an `Order` to `path`; returns (`Window` of the file, samples
      taken).
    - `files(path)`: returns the fields of the answer to `files`.
    """
    line.send("ready", engine=worker.name, version=worker.version, protocol=PROTOCOL)
    frame = None
    for text in line.requests():
        request_id = None
        try:
            request = json.loads(text)
            if not isinstance(request, dict):
                raise Refusal("a request is not a JSON object")
            request_id = request.get("id")
            if request.get("do") == "open":
                frame = None  # A scene that cannot be opened leaves none open.
            frame = answer(line, worker, request, frame)
        except Refusal as refusal:
            line.fail(refusal.reason, request_id, refusal.fatal)
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            traceback.print_exc()
            line.fail(f"{type(error).__name__}: {error}", request_id)
        except Exception as error:
            traceback.print_exc()
            line.fail(str(error) or type(error).__name__, request_id)


def answer(line, worker, request, frame):
    """Does one request. `frame`: (width, height, scratch) of the open scene, or None; returns it as it is afterwards."""
    what = request.get("do")
    if what == "open":
        existing_file(request["scene"])
        opened = worker.open(request)
        frame = (opened["width"], opened["height"], request["scratch"])
        line.send("opened", **opened)
    elif what == "paint":
        if frame is None:
            raise Refusal("no scene is open")
        width, height, scratch = frame
        order = Order(request, width, height)
        path = os.path.join(scratch, f"{order.id}.exr")
        started = time.monotonic()
        window, samples, *once = worker.paint(order, path, Progress(line, order.id))
        seconds = time.monotonic() - started
        line.send("painted", id=order.id, file=path, window=window.as_list(), samples=samples,
                  seconds=round(seconds, 4), once=round(sum(once), 4))
    elif what == "files":
        line.send("files", **worker.files(existing_file(request["scene"])))
    else:
        raise Refusal(f"unknown request `{what}`")
    return frame
