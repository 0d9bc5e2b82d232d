"""Binary glTF 2.0 (``.glb``): arrays in one buffer, described by JSON (Khronos' specification, chapters 3.6 and 4)."""

from __future__ import annotations

import json
import re
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from capture.own import Mark, replaced_if_own

_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_COMPONENTS = {np.dtype("<u1"): 5121, np.dtype("<u2"): 5123, np.dtype("<u4"): 5125, np.dtype("<f4"): 5126}
_TARGETS = {"vertices": 34962, "faces": 34963}
GENERATOR = "bonetrack"
MARK = Mark(re.compile(rb'\AglTF.{16}\{"asset":\{[^}]*"generator":"%b"' % GENERATOR.encode(), re.DOTALL))
_SHAPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}


@dataclass
class Glb:
    """A glTF file in the making: arrays are added one by one, the rest of the document is given when it is written."""

    _buffer: bytearray = field(default_factory=bytearray)
    _views: list[dict[str, Any]] = field(default_factory=list)
    _accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(
        self,
        values: NDArray[Any],
        kind: Literal["<f4", "<u4", "<u2", "<u1"] = "<f4",
        *,
        use: Literal["vertices", "faces"] | None = None,
        bounds: bool = False,
    ) -> int:
        """Store values (N, ...) as numbers of a kind and return their accessor's index.

        ``use`` says what they are for where that is a mesh; ``bounds`` adds the least and the largest value, which
        glTF wants of positions and of key times. Transforms (N, 4, 4) act on columns, as everywhere here; glTF stores
        them column by column.
        """
        array = np.asarray(values).astype(kind)
        shape = _SHAPES[array.shape[1:]]
        stored = array.swapaxes(1, 2) if shape == "MAT4" else array
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._buffer), "byteLength": array.nbytes}
        self._views.append(view | ({"target": _TARGETS[use]} if use else {}))
        self._buffer += np.ascontiguousarray(stored).tobytes()
        self._buffer += bytes(-len(self._buffer) % 4)
        accessor = {
            "bufferView": len(self._views) - 1,
            "componentType": _COMPONENTS[array.dtype],
            "count": len(array),
            "type": shape,
        }
        if bounds:
            accessor |= {
                name: np.atleast_1d(value).tolist()
                for name, value in (("min", array.min(axis=0)), ("max", array.max(axis=0)))
            }
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def write(self, path: Path, document: dict[str, Any]) -> None:
        """Write the file: ``document`` holds everything but buffers, views, accessors and what the file says of itself.

        Raises:
            OutputError: something stands there that bonetrack did not write.
        """
        whole = {"asset": {"version": "2.0", "generator": GENERATOR}, **document} | {
            "buffers": [{"byteLength": len(self._buffer)}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(whole, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON) + text
        chunks += struct.pack("<II", len(self._buffer), _BIN) + bytes(self._buffer)
        with replaced_if_own(path, MARK) as partial:
            partial.write_bytes(struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks)
