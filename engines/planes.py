"""Pictures as sums, plane by plane. NumPy makes them faster where it is installed, and is not needed: the same sums come
out of both.
"""

import array
import ctypes
import operator
import struct

try:
    import numpy as np
except ImportError:
    np = None


class Sums:
    """`count` planes of `height` rows of `width` numbers, all 0 at first."""

    def __init__(self, count, height, width):
        self.height, self.width = height, width
        if np:
            self.planes = np.zeros((count, height, width), np.float64)
        else:
            self.planes = [[array.array("d", bytes(8 * width)) for _ in range(height)] for _ in range(count)]

    def add(self, plane, part, height, top=0, left=0):
        """Adds `height` rows as wide as these with their corner at (left, top), without what lies outside."""
        y0, y1 = max(top, 0), min(top + height, self.height)
        x0, x1 = max(left, 0), min(left + self.width, self.width)
        if y0 >= y1 or x0 >= x1:
            return
        if np:
            part = np.asarray(part).reshape(height, self.width)
            self.planes[plane, y0:y1, x0:x1] += part[y0 - top:y1 - top, x0 - left:x1 - left]
            return
        rows = self.planes[plane]
        for y in range(y0, y1):
            start = (y - top) * self.width - left
            row = rows[y]
            row[x0:x1] = array.array("d", map(operator.add, row[x0:x1], part[start + x0:start + x1]))

    def add_number(self, plane, y0, y1, number):
        """Adds a number to all of some rows."""
        if np:
            self.planes[plane, y0:y1] += number
            return
        for y in range(y0, y1):
            row = self.planes[plane][y]
            row[:] = array.array("d", (value + number for value in row))

    def means(self, plane, x0, y0, x1, y1, weights=None, weight=1.0):
        """A part of a plane by its weights, which are a plane or one number: 32-bit floats, row by row."""
        if np:
            by = weight if weights is None else self.planes[weights, y0:y1, x0:x1]
            by = np.where(by == 0.0, 1.0, by)
            return np.ascontiguousarray(self.planes[plane, y0:y1, x0:x1] / by, np.float32)
        means = array.array("f")
        for y in range(y0, y1):
            by = [weight] * (x1 - x0) if weights is None else self.planes[weights][y][x0:x1]
            means.extend(map(operator.truediv, self.planes[plane][y][x0:x1], (value or 1.0 for value in by)))
        return means


def scaled(values, factor):
    """Each of some numbers times a factor, in 64 bits."""
    if np:
        return np.asarray(values, np.float64) * factor
    return array.array("d", (value * factor for value in values))


def of_bitmap(bitmap):
    """The channels of a bitmap of Mitsuba, one after the other: each as many numbers as it has pixels."""
    count = bitmap.channel_count()
    if np:
        flat = np.array(bitmap, np.float32).reshape(-1)
    else:
        # `Bitmap.convert` would do for all kinds of numbers, and forgets the names of layers.
        kinds = {"Float16": "e", "Float32": "f", "Float64": "d"}
        kind = kinds[str(bitmap.component_format()).rpartition(".")[2]]
        address, _ = bitmap.__array_interface__["data"]
        numbers = struct.iter_unpack(kind, ctypes.string_at(address, bitmap.buffer_size()))
        flat = array.array("f", (number for (number,) in numbers))
    return [flat[index::count] for index in range(count)]


def of_array(values):
    """The numbers of an evaluated array of Dr.Jit."""
    if np:
        return np.array(values)
    return _of_tensor(values.__dlpack__())


class _Tensor(ctypes.Structure):
    """What a capsule of the DLPack exchange holds (DLPack, dlpack.h, version 0)."""

    _fields_ = [("data", ctypes.c_void_p), ("device", ctypes.c_int32), ("device_id", ctypes.c_int32),
                ("dimensions", ctypes.c_int32), ("kind", ctypes.c_uint8), ("bits", ctypes.c_uint8),
                ("lanes", ctypes.c_uint16), ("shape", ctypes.POINTER(ctypes.c_int64)),
                ("strides", ctypes.POINTER(ctypes.c_int64)), ("offset", ctypes.c_uint64)]


def _of_tensor(capsule):
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    tensor = _Tensor.from_address(pointer_of(capsule, b"dltensor"))
    if (tensor.device, tensor.dimensions, tensor.kind, tensor.bits) != (1, 1, 2, 32):
        raise ModuleNotFoundError("these numbers are on a device: No module named 'numpy'")
    return array.array("f", (ctypes.c_float * tensor.shape[0]).from_address(tensor.data + tensor.offset))
