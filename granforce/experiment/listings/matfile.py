"""Struct arrays from MATLAB files of version 5 to 7, field by field.

The format follows "MAT-File Format" of MathWorks: after a header of 128 bytes come elements, each a
tag (type, number of bytes; both in four bytes if the data have four or fewer) and its data, padded
to eight bytes. A variable is an element of type 14 that contains others: class and flags,
dimensions, name, and for a struct the names of its fields and the field of each part. SciPy's
reader crashes the process on some damaged files, and also unpacks the images, which are not needed.
"""

import struct
import zlib
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

_MATRIX, _PACKED = 14, 15
_STRUCT, _NUMBERS = 2, range(6, 16)
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8"}
_TYPES[13] = "u8"
_HEADER = 128
_MOST_PARTS = 10**6


class _Element(NamedTuple):
    kind: int
    start: int  # of its data
    size: int
    end: int  # start of the next element


class _Reader:
    """Elements of a byte string; ValueError if they violate the format."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order = data, order

    def element(self, at: int, end: int) -> _Element:
        """The _Element whose tag is at the offset `at`, before `end`."""
        if at + 8 > end:
            raise ValueError("cut off")
        kind, size = struct.unpack_from(f"{self.order}II", self.data, at)
        if kind >> 16:
            kind, size, start, after = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError("small element")
        else:
            start = at + 8
            after = start + size + (0 if kind == _PACKED else -size % 8)
        if start + size > end:
            raise ValueError("cut off")
        return _Element(kind, start, size, min(after, end))

    def values(self, element: _Element) -> npt.NDArray[Any]:
        """An element's plain numbers."""
        code = np.dtype(self.order + _TYPES[element.kind])
        return np.frombuffer(self.data, code, element.size // code.itemsize, element.start)

    def text(self, element: _Element) -> str:
        """An element's characters."""
        return bytes(self.data[element.start : element.start + element.size]).decode("latin-1")

    def head(self, matrix: _Element) -> tuple[int, npt.NDArray[Any], str, int]:
        """Class, dimensions and name of a variable, and the offset of its contents."""
        end = matrix.start + matrix.size
        flags = self.element(matrix.start, end)
        shape = self.element(flags.end, end)
        name = self.element(shape.end, end)
        word = int(self.values(flags)[0])
        return word & 0xFF, self.values(shape), self.text(name), name.end

    def numbers(self, matrix: _Element) -> npt.NDArray[Any]:
        """The real part of a numeric variable, flat; an empty array for other variables."""
        if not matrix.size:
            return np.zeros(0)
        kind, shape, _, at = self.head(matrix)
        if kind not in _NUMBERS:
            return np.zeros(0)
        numbers = self.values(self.element(at, matrix.start + matrix.size))
        if len(numbers) != np.prod(shape, dtype=float):
            raise ValueError("dimensions")
        return numbers

    def parts(self, matrix: _Element, wanted: Collection[str]) -> list[dict[str, npt.NDArray[Any]]]:
        """Parts of a struct array: a list of {field: flat numbers} of the wanted fields."""
        kind, shape, _, at = self.head(matrix)
        end = matrix.start + matrix.size
        count = np.prod(shape, dtype=float)
        if kind != _STRUCT or not 0 <= count <= _MOST_PARTS:
            return []
        length = self.element(at, end)
        names = self.element(length.end, end)
        width = int(self.values(length)[0])
        if width < 1:
            raise ValueError("names of the fields")
        text, at = self.text(names), names.end
        fields = [text[k : k + width].split("\0")[0] for k in range(0, len(text), width)]
        parts = []
        for _ in range(int(count) if fields else 0):
            part = {}
            for field in fields:
                element = self.element(at, end)
                if element.kind != _MATRIX:
                    raise ValueError("field")
                if field in wanted:
                    part[field] = self.numbers(element)
                at = element.end
            parts.append(part)
        return parts


def read_struct(
    content: bytes, name: str, wanted: Collection[str], most: int
) -> list[dict[str, npt.NDArray[Any]]]:
    """Parts of the struct array `name` in a file's bytes: a list of {field: flat numbers}.

    An empty list if there is none. most: largest number of bytes to unpack. Raises ValueError,
    KeyError, zlib.error or struct.error if the file is damaged.
    """
    order = {b"IM": "<", b"MI": ">"}[content[126:128]]
    at, outside = _HEADER, _Reader(content, order)
    while at + 8 <= len(content):
        reader, element = outside, outside.element(at, len(content))
        at = element.end
        if element.kind == _PACKED:
            packed = content[element.start : element.start + element.size]
            unpacked = zlib.decompressobj().decompress(packed, most)
            reader = _Reader(unpacked, order)
            element = reader.element(0, len(unpacked))
        if element.kind == _MATRIX and element.size and reader.head(element)[2] == name:
            return reader.parts(element, wanted)
    return []
