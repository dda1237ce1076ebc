# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python module `bottega` and its programs.

As an extension Blender unpacks the wheels itself. The add-on for Blender before 4.2 carries them unpacked in the folder `library`.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

_CARRIED = Path(__file__).parent / "library"


def prepare() -> None:
    """Lets Python find the carried modules."""
    if _CARRIED.is_dir() and str(_CARRIED) not in sys.path:
        sys.path.insert(0, str(_CARRIED))


def problem() -> str | None:
    """Returns why the renderer cannot be used, and the remedy; `None`: it can."""
    try:
        import bottega  # noqa: F401
    except ImportError as error:
        if "numpy" in str(error):
            return f"NumPy cannot be loaded ({error}). Install it for the Python of Blender (Debian: python3-numpy)"
        return f"The module bottega cannot be loaded ({error}). Install the extension for this system and this version of Blender again"
    return None


def program(name: str) -> Path | None:
    """Returns a carried program, `bottega` or `nats-server`, made executable; `None`: it is not here.

    Blender unpacks wheels without the executable bit.
    """
    import bottega

    site = Path(bottega.__file__).parent.parent
    # As pip unpacks a wheel, and as Blender does.
    places = [*site.glob(f"*.data/scripts/{name}"), site.parent.parent.parent / "bin" / name]
    for path in places:
        if path.is_file():
            if not os.access(path, os.X_OK):
                path.chmod(path.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP)
            return path
    return None
