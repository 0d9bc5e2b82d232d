"""The depth compression of OpenNI's ``.oni`` files, "16z" with and without an embedded table, undone.

The image is one row of values; a value is told by its difference from the one before. A byte below E0 holds two
differences, one in each half: 0 to 12 stand for +6 to -6 (the value before less this one is the code less 6), D in the
lower half for none, F in the lower half for a larger one that follows. FF is a larger one alone. E0 to FE stand for
runs of equal pairs. A larger one is a byte from 80 on (192 + the value before less this one), or two bytes, the value
itself. With a table, all values are places in a list of the readings that occur, which goes ahead.

The stream must be walked byte by byte only where larger ones stand; all else is done with arrays.
Source: ``XnStreamCompression.cpp`` of OpenNI 2 (Apache-2.0), for the meaning of the codes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_Integers = NDArray[np.int64]


def decode_with_table(data: bytes, count: int) -> NDArray[np.uint16]:
    """The readings (count,) of a "16zT" image.

    >>> table = bytes([2, 0, 0xE8, 0x03, 0xD0, 0x07])  # two readings occur: 1000 and 2000
    >>> decode_with_table(table + bytes([0, 0, 0x57]), 3).tolist()
    [1000, 2000, 1000]

    Raises:
        ValueError: it does not hold this many, or not in this way.
    """
    if len(data) < 4:
        raise ValueError("a depth image is too short")
    entries = int.from_bytes(data[:2], "little")
    begin = 2 + 2 * entries
    if entries == 0 or len(data) < begin + 2:
        raise ValueError("a depth image is too short for its table")
    table = np.frombuffer(data, "<u2", count=entries, offset=2).astype(np.uint16)
    places = decode(data[begin:], count)
    if int(places.max()) >= entries:
        raise ValueError("a depth image leads out of its table")
    return np.asarray(table[places])


def decode(data: bytes, count: int) -> NDArray[np.uint16]:
    """The values (count,) of a "16zP" image.

    >>> decode(bytes([0xE8, 0x03, 0x57, 0x6D]), 4).tolist()  # 1000; +1 and -1; +0 and no other
    [1000, 1001, 1000, 1000]

    Raises:
        ValueError: it does not hold this many.
    """
    if len(data) < 2:
        raise ValueError("a depth image is too short")
    code = np.frombuffer(data, np.uint8, offset=2).astype(np.int64)
    at, argument_bytes = _larger_ones(code)
    begins = np.ones(len(code), dtype=bool)
    begins[at + 1] = False
    begins[(at + 2)[argument_bytes == 2]] = False

    low = code & 0x0F
    pairs = begins & (code < 0xE0)
    run = begins & (code >= 0xE0) & (code < 0xFF)
    held = np.where(pairs, np.where(low == 0x0D, 1, 2), np.where(run, 2 * (code - 0xE0), 0))
    held[begins & (code == 0xFF)] = 1
    if int(held.sum()) + 1 != count:
        raise ValueError(f"a depth image holds {int(held.sum()) + 1} readings, not {count}")
    first = 1 + np.cumsum(held) - held

    steps = np.zeros(count, dtype=np.int64)
    steps[first[pairs]] = 6 - (code[pairs] >> 4)
    two = pairs & (low != 0x0D) & (low != 0x0F)
    steps[first[two] + 1] = 6 - low[two]
    place = first[at] + (code[at] < 0xE0)
    near = argument_bytes == 1
    steps[place[near]] = 192 - code[at[near] + 1]
    given = np.concatenate([[0], place[~near]])
    values = np.concatenate([[int.from_bytes(data[:2], "little")], code[at[~near] + 1] * 256 + code[at[~near] + 2]])
    return _summed(steps, given, values)


def _larger_ones(code: _Integers) -> tuple[_Integers, NDArray[np.int64]]:
    """Where the codes stand that larger differences follow, and how many bytes each takes (1 or 2)."""
    places: list[int] = []
    lengths: list[int] = []
    free, end = 0, len(code)
    for at in np.flatnonzero((code & 0x0F == 0x0F) & ((code < 0xE0) | (code == 0xFF))).tolist():
        if at < free:
            continue  # it is itself a part of a larger one
        length = 1 if at + 1 < end and code[at + 1] & 0x80 else 2
        if at + length >= end:
            raise ValueError("a depth image is cut short")
        places.append(at)
        lengths.append(length)
        free = at + 1 + length
    return np.array(places, dtype=np.int64), np.array(lengths, dtype=np.int64)


def _summed(steps: _Integers, given: _Integers, values: _Integers) -> NDArray[np.uint16]:
    """Running sums of steps that begin anew with ``values`` at the places ``given``, in 16 bits."""
    total = np.cumsum(steps)
    latest = np.zeros(len(steps), dtype=np.int64)
    latest[given] = np.arange(len(given))
    offset = (values - total[given])[np.maximum.accumulate(latest)]
    return np.asarray((total + offset) & 0xFFFF, dtype=np.uint16)
