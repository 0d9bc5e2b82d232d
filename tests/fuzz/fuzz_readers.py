"""Fuzzes one reader with atheris (PyPI ``atheris``); not part of the test suite.

Run as ``python -m tests.fuzz.fuzz_readers NAME [options of libFuzzer]``, with a NAME of targets.py, for instance
``... openni -max_total_time=120``. It begins from the valid files and stops at the first input out of which anything
but a ``BonetrackError`` comes, which libFuzzer then keeps as ``crash-...``.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["capture", "rosbags"]):
    from capture.errors import BonetrackError
    from tests.fuzz.targets import TARGETS


def main() -> None:
    target = TARGETS[sys.argv.pop(1)]
    scratch = Path(tempfile.mkdtemp(prefix="fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    corpus = Path(tempfile.mkdtemp(prefix="corpus-"))
    seeds = target.seeds()
    for number, seed in enumerate(seeds):
        (corpus / str(number)).write_bytes(seed)

    def one(data: bytes) -> None:
        try:
            target.read(data, scratch)
        except BonetrackError as error:
            if "\n" in str(error):
                raise AssertionError("an error of more than one line") from error

    longest = 2 * max(map(len, seeds))
    atheris.Setup([sys.argv[0], f"-max_len={longest}", *sys.argv[1:], str(corpus)], one)
    try:
        atheris.Fuzz()
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


if __name__ == "__main__":
    main()
