"""Ctrl-C, threads, forks, the end of the interpreter."""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import child

import bottega

LONG = "spp=1_000_000, size=(320, 240)"

INTERRUPT = """
import os, signal, threading
import bottega

# A shell has what it runs in the background ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)

def press_once_it_paints(event):
    if event["event"] == "progress" and event["samples_done"] > 100_000 and not pressed:
        pressed.append(event)
        threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()

pressed = []
session = bottega.Session({scene!r}, {long})
try:
    session.render(on_event=press_once_it_paints)
    print("whole")
except KeyboardInterrupt as interrupt:
    print(type(interrupt).__name__, interrupt.picture.is_whole, interrupt.picture.color.mean() > 0)
    interrupt.picture.save({out!r})
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_ctrl_c_keeps_what_is_painted(box: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "part.png")
    said = child(INTERRUPT.format(scene=str(box), out=out, long=LONG))
    assert said.strip() == "Interrupted False True"
    assert bottega.read(out).color.shape == (240, 320, 3)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_a_handler_of_signals_runs_while_a_picture_is_painted(box: Path) -> None:
    said = child(f"""
import os, signal, threading, bottega
signal.signal(signal.SIGINT, lambda *_: print("seen", flush=True) or session.stop())
session = bottega.Session({str(box)!r}, {LONG})
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
print(session.render().is_whole)
""")
    assert said.split() == ["seen", "False"]


def test_other_threads_run_while_a_picture_is_painted(box: Path) -> None:
    session = bottega.Session(box, spp=1_000_000, size=(320, 240), live=True)
    pictures: list[bottega.Picture] = []
    thread = threading.Thread(target=lambda: pictures.append(session.render()))
    thread.start()
    counted, preview = 0, None
    end = time.monotonic() + 20
    while time.monotonic() < end and (preview is None or counted < 1000):
        counted += 1
        preview = session.preview()
        time.sleep(0.001)
    session.stop()
    thread.join(20)
    assert not thread.is_alive() and counted >= 1000
    assert preview is not None and preview.shape == (240, 320, 3) and preview.dtype == np.uint8 and preview.max() > 0
    assert (session.preview_png() or b"").startswith(b"\x89PNG")
    assert not pictures[0].is_whole
    with pytest.raises(bottega.Error, match="once"):
        session.render()


def test_a_session_may_be_dropped_while_it_is_painted(box: Path) -> None:
    """The thread that paints has it as well; a session that was never painted just goes."""
    sessions = [bottega.Session(box, spp=200, size=(64, 48)) for _ in range(4)]
    pictures: list[bottega.Picture] = []
    threads = [threading.Thread(target=lambda s=session: pictures.append(s.render())) for session in sessions[:3]]
    for thread in threads:
        thread.start()
    del sessions
    for thread in threads:
        thread.join(60)
    assert [picture.is_whole for picture in pictures] == [True] * 3


def test_the_interpreter_may_end_while_a_thread_paints(box: Path) -> None:
    begun = time.monotonic()
    child(f"""
import threading, time, bottega
session = bottega.Session({str(box)!r}, {LONG})
threading.Thread(target=session.render, daemon=True).start()
time.sleep(0.5)
""")
    assert time.monotonic() - begun < 20


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_is_reported(box: Path) -> None:
    said = child(f"""
import os, warnings, bottega
warnings.simplefilter("ignore")
def forked(what):
    child = os.fork()
    if child == 0:
        try:
            what()
            print("painted", flush=True)
        except bottega.ForkError as error:
            print(type(error).__name__, "spawn" in error.remedy, flush=True)
        os._exit(0)
    os.waitpid(child, 0)
paint = lambda: bottega.render({str(box)!r}, spp=1, size=(8, 8))
forked(paint)
session = bottega.Session({str(box)!r}, spp=1, size=(8, 8))
forked(paint)
forked(session.render)
forked(lambda: bottega.analyze({str(box)!r}, size=(8, 8)))
print(session.render().is_whole)
""")
    assert said.split("\n")[:-1] == ["painted", *["ForkError True"] * 3, "True"]
