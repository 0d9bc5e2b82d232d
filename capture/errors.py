"""The one family of errors that users see: what is wrong, where, and what to do."""

from __future__ import annotations

from pathlib import Path


class BonetrackError(Exception):
    """Any failure that the user can understand and mend.

    Args:
        problem: what is wrong, one line.
        where: the file, folder or frame it concerns.
        remedy: what to do about it, one line.
    """

    def __init__(self, problem: str, *, where: str | Path | None = None, remedy: str = "") -> None:
        self.problem = problem
        self.where = None if where is None else str(where)
        self.remedy = remedy
        super().__init__(self._one_line())

    def _one_line(self) -> str:
        line = self.problem if self.where is None else f"{self.where}: {self.problem}"
        return f"{line}; {self.remedy}" if self.remedy else line


class OutputError(BonetrackError):
    """Something stands where a result is to be written that bonetrack did not write."""


class RecordingError(BonetrackError):
    """A recording (its folder, an image, a time stamp) is not what the format asks for."""


class CalibrationError(BonetrackError):
    """The box frames do not determine where a sensor stands."""


class CloudError(BonetrackError):
    """A point cloud cannot serve: empty, not finite, or nothing in the region of interest."""


class AnatomyError(BonetrackError):
    """An anatomy, a subject or a pose does not fit what is asked of it."""


class FitError(BonetrackError):
    """Fitting cannot be done with the data given."""
