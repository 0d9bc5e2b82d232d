"""Files of others are read as far as they may be and no farther; what cannot be read says so by the error asked for."""

from __future__ import annotations

import pytest

from capture.bounded import read_at_most, read_head
from capture.errors import CalibrationError, RecordingError


def test_a_file_is_read_up_to_its_limit_and_refused_beyond(tmp_path):
    file = tmp_path / "list.txt"
    file.write_bytes(b"12345")
    assert read_head(file, 3) == b"123"
    assert read_at_most(file, 5, remedy="shorten it") == b"12345"
    with pytest.raises(CalibrationError, match=r"list\.txt: is larger than 4 bytes; shorten it"):
        read_at_most(file, 4, remedy="shorten it", error=CalibrationError)


def test_what_cannot_be_read_names_the_file_and_why(tmp_path):
    with pytest.raises(RecordingError, match=r"none\.txt: cannot be read \(No such file or directory\)"):
        read_at_most(tmp_path / "none.txt", 5, remedy="shorten it")
    with pytest.raises(CalibrationError, match=r"cannot be read \(Is a directory\)"):
        read_at_most(tmp_path, 5, remedy="shorten it", error=CalibrationError)
