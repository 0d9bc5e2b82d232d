"""Pictures of a scene one after the other, as MP4 by PyAV, and one of them as PNG."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from capture.errors import BonetrackError
from capture.own import WRITTEN, Mark, replaced_if_own, tail
from track.view.stills import Image

MP4 = Mark(re.compile(re.escape(WRITTEN.encode())), tail)
_TICKS = 90000  # a second, in which times are kept
_LAST_S = 1.0 / 30.0  # what the last picture of one alone would last


class FilmError(BonetrackError):
    """A film cannot be made."""


def refuse_without_av() -> None:
    """Raise FilmError where PyAV is missing."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise FilmError("a film needs PyAV", remedy="pip install 'bonetrack[movie]'") from error


def write_film(images: Iterable[Image], times: Floats, path: Path) -> int:
    """Write pictures (H, W, 3), all of one size, that are shown from times (T,) s on; returns how many there are.

    H.264 in colours that every player knows; of odd sizes the last row or column is cut off. Times are kept as they
    are, from 0 at the first, so that a film is as long as what it shows, also where frames are missing.

    Raises:
        FilmError: PyAV is missing.
        OutputError: something stands there that bonetrack did not write.
    """
    refuse_without_av()
    import av

    step = float(np.median(np.diff(times))) if len(times) > 1 else _LAST_S
    count = 0
    with replaced_if_own(path, MP4) as partial, av.open(str(partial), "w", format="mp4") as film:
        film.metadata["comment"] = WRITTEN
        stream = film.add_stream("libx264", rate=Fraction(1.0 / step).limit_denominator(1001))
        stream.pix_fmt, stream.options = "yuv420p", {"crf": "20"}
        stream.time_base = stream.codec_context.time_base = Fraction(1, _TICKS)
        for image, time in zip(images, times, strict=True):
            height, width = (length // 2 * 2 for length in image.shape[:2])
            if not count:
                stream.width, stream.height = width, height
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image[:height, :width]), format="rgb24")
            frame.pts, frame.time_base = round(_TICKS * float(time - times[0])), Fraction(1, _TICKS)
            film.mux(stream.encode(frame))
            count += 1
        film.mux(stream.encode(None))
    return count
