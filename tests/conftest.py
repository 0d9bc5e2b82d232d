from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before anything imports numpy

import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from tests.known_limb import ANATOMY, KnownLimb, record
from tests.raw_files import FinishedRun, finish_run


@pytest.fixture(scope="session")
def arm() -> Anatomy:
    return load_anatomy(ANATOMY)


@pytest.fixture(scope="session")
def limb(arm: Anatomy, tmp_path_factory: pytest.TempPathFactory) -> KnownLimb:
    """One small recording for all tests; none may change it."""
    return record(arm, tmp_path_factory.mktemp("limb") / "recording")


@pytest.fixture(scope="session")
def finished_run(limb: KnownLimb, tmp_path_factory: pytest.TempPathFactory) -> FinishedRun:
    """A whole run on raw images of the small recording, once for all tests; none may change it."""
    return finish_run(limb, tmp_path_factory.mktemp("run"))
