"""LZF, with which ``binary_compressed`` PCD files are packed.

A byte below 32 says how many bytes (one more) follow as they are. Any other begins a copy of what was unpacked before:
its upper three bits, and the next byte where they are all ones, are the length less two; its lower five and the byte
after are how far back, less one. Source: the format as described in ``lzf_d.c`` of M. Lehmann's LibLZF.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from capture.compiled import compiled

_Bytes = NDArray[np.uint8]


def unpacked(data: bytes, size: int) -> bytes:
    """The ``size`` bytes that the data were packed from.

    Raises:
        ValueError: the data are damaged, or were packed from more or fewer bytes.
    """
    out = np.zeros(size, dtype=np.uint8)
    if not _unpack(np.frombuffer(data, dtype=np.uint8), out):
        raise ValueError("its compressed points are damaged")
    return out.tobytes()


def unpack(data: _Bytes, out: _Bytes) -> bool:
    """Fill ``out`` (M,) from ``data`` (N,); False if they do not fit each other.

    >>> out = np.zeros(6, dtype=np.uint8)
    >>> unpack(np.array([1, 97, 98, 2 << 5, 1], dtype=np.uint8), out), out.tobytes()  # "ab", and 4 bytes from 2 back
    (True, b'ababab')
    """
    at, to = 0, 0
    while at < len(data):
        control = int(data[at])
        at += 1
        if control < 32:
            count = control + 1
            if at + count > len(data) or to + count > len(out):
                return False
            for _ in range(count):
                out[to] = data[at]
                at, to = at + 1, to + 1
            continue
        count = control >> 5
        if count == 7:
            if at >= len(data):
                return False
            count += int(data[at])
            at += 1
        if at >= len(data):
            return False
        back = to - (((control & 31) << 8) + int(data[at]) + 1)
        at += 1
        if back < 0 or to + count + 2 > len(out):
            return False
        for _ in range(count + 2):  # byte by byte: what is copied may be what is being written
            out[to] = out[back]
            back, to = back + 1, to + 1
    return to == len(out)


_unpack = compiled(unpack)
