"""OpenEXR files with nothing but Python's standard library, for workers that must not load a second native library.

Writes and reads single-part scanline files: 32-bit float when writing; half, float and uint, uncompressed, RLE-free,
ZIPS or ZIP when reading. NumPy makes reading faster where it is installed, and is not needed.

Source: the OpenEXR project, OpenEXR File Layout, openexr.com, 2024.
"""

import array
import itertools
import struct
import sys
import zlib

MAGIC = 20000630
HALF, FLOAT = 1, 2
NONE, ZIPS, ZIP = 0, 2, 3
ROWS_OF_CHUNK = {NONE: 1, ZIPS: 1, ZIP: 16}
SIZE_OF = {0: 4, HALF: 2, FLOAT: 4}


def write(path, width, height, channels):
    """Writes `channels`: name -> `width * height` native 32-bit floats (an array, memoryview or NumPy array, contiguous), top row first."""
    names = sorted(channels)
    planes = [_bytes_of(channels[name], width * height, name) for name in names]
    header = _header(width, height, names)
    row_bytes = width * 4
    chunk_bytes = 8 + row_bytes * len(names)
    first = len(header) + 8 * height
    with open(path, "wb") as file:
        file.write(header)
        file.write(struct.pack(f"<{height}Q", *(first + y * chunk_bytes for y in range(height))))
        for y in range(height):
            file.write(struct.pack("<ii", y, row_bytes * len(names)))
            for plane in planes:
                file.write(plane[y * row_bytes:(y + 1) * row_bytes])


def _bytes_of(plane, count, name):
    view = memoryview(plane).cast("B")
    if len(view) != 4 * count:
        raise ValueError(f"channel {name} has {len(view)} bytes, not {4 * count}")
    if sys.byteorder == "big":
        swapped = array.array("f", bytes(view))
        swapped.byteswap()
        view = memoryview(swapped).cast("B")
    return view


def _header(width, height, names):
    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", FLOAT, 0, 1, 1) for name in names) + b"\0"
    long_names = any(len(name) > 31 for name in names)
    return b"".join([
        struct.pack("<ii", MAGIC, 2 | (0x400 if long_names else 0)),
        attribute("channels", "chlist", listed),
        attribute("compression", "compression", bytes([NONE])),
        attribute("dataWindow", "box2i", window),
        attribute("displayWindow", "box2i", window),
        attribute("lineOrder", "lineOrder", b"\0"),
        attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        b"\0",
    ])


class Picture:
    """What was read: `channels` name -> `array('f')` of `width * height`, top row first."""

    def __init__(self, width, height, channels):
        self.width, self.height, self.channels = width, height, channels

    def cut(self, x0, y0, x1, y1):
        """The part with x0 <= x < x1, y0 <= y < y1, as another picture."""
        def rows(plane):
            part = array.array("f")
            for y in range(y0, y1):
                part.extend(plane[y * self.width + x0:y * self.width + x1])
            return part
        return Picture(x1 - x0, y1 - y0, {name: rows(plane) for name, plane in self.channels.items()})


def read(path, rows=None):
    """Reads the whole data window, or only `rows` (first, end) of it: then the others are black. Raises ValueError,
    with the path, on what this reader does not know."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        return _read(data, rows)
    except (struct.error, IndexError, zlib.error, KeyError, ValueError) as error:
        raise ValueError(f"{path}: not an OpenEXR file that can be read here: {error}") from error


def _read(data, wanted_rows):
    magic, version = struct.unpack_from("<ii", data, 0)
    if magic != MAGIC or version & 0x1A00:
        raise ValueError("neither tiles, deep data nor several parts can be read")
    attributes, at = _attributes(data, 8)
    compression = attributes["compression"][0]
    if compression not in ROWS_OF_CHUNK:
        raise ValueError(f"compression {compression}")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    listed = _channel_list(attributes["channels"])
    planes = {name: array.array("f", bytes(4 * width * height)) for name, _ in listed}
    row_bytes = sum(SIZE_OF[kind] for _, kind in listed) * width
    rows = ROWS_OF_CHUNK[compression]
    for start in struct.unpack_from(f"<{-(-height // rows)}Q", data, at):
        y, size = struct.unpack_from("<ii", data, start)
        y -= top
        if wanted_rows and (y >= wanted_rows[1] or y + rows <= wanted_rows[0]):
            continue
        wanted = row_bytes * min(rows, height - y)
        chunk = data[start + 8:start + 8 + size]
        if compression != NONE and size < wanted:
            chunk = _unzip(chunk)
        if len(chunk) != wanted:
            raise ValueError(f"row {y} is cut short")
        _scatter_rows(chunk, listed, planes, width, y, min(rows, height - y))
    return Picture(width, height, planes)


def _attributes(data, at):
    found = {}
    while data[at]:
        end = data.index(b"\0", at)
        name = data[at:end].decode()
        end = data.index(b"\0", end + 1)
        size, = struct.unpack_from("<i", data, end + 1)
        found[name] = data[end + 5:end + 5 + size]
        at = end + 5 + size
    return found, at + 1


def _channel_list(data):
    listed, at = [], 0
    while data[at]:
        end = data.index(b"\0", at)
        kind, = struct.unpack_from("<i", data, end + 1)
        listed.append((data[at:end].decode(), kind))
        at = end + 17
    return listed


def _unzip(chunk):
    """Undoes zlib, the predictor (each byte is a difference, plus 128) and the halving of the bytes."""
    packed = zlib.decompress(chunk)
    try:
        import numpy
        differences = numpy.frombuffer(packed, numpy.uint8).astype(numpy.int64)
        differences[1:] -= 128
        plain = (numpy.cumsum(differences) & 255).astype(numpy.uint8).tobytes()
    except ImportError:
        plain = bytes(itertools.accumulate(packed, lambda a, b: (a + b - 128) & 255))
    half = (len(plain) + 1) // 2
    joined = bytearray(len(plain))
    joined[0::2] = plain[:half]
    joined[1::2] = plain[half:]
    return bytes(joined)


def _scatter_rows(chunk, listed, planes, width, y, rows):
    at = 0
    for row in range(y, y + rows):
        for name, kind in listed:
            values = struct.unpack_from(f"<{width}{'Ief'[kind]}", chunk, at)
            planes[name][row * width:(row + 1) * width] = array.array("f", values)
            at += width * SIZE_OF[kind]
