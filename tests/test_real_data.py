"""A real person before one real sensor; the margins are about 1.5 times what was measured."""

from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.fit.correspondences import Target
from adapt.fit.start import find_pose
from adapt.model.body import make_body
from capture.camera import Camera
from capture.fuse import fuse
from capture.importers import import_images, natural_order, source_files
from capture.recording import Recording, Region, instants

KINECT = Path(__file__).parents[2] / "shared" / "recordings" / "upperbody_arms_kinect1_skeltrack"
RIGHT_HALF = Region(np.array([-0.75, -0.6, 0.5]), np.array([0.02, 0.7, 1.7]))

pytestmark = pytest.mark.skipif(not KINECT.is_dir(), reason="the real recording is not at hand")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    camera = Camera(640, 480, 585.0, 585.0, 319.5, 239.5)
    files = natural_order(source_files(KINECT, "depth-data-*"))
    return import_images(
        files, tmp_path_factory.mktemp("real") / "rec", kind="raw", camera=camera, depth_unit_m=0.001, fps=0.1
    )


@pytest.mark.parametrize(("frame", "elbow_deg"), [(7, (10.0, 50.0)), (10, (10.0, 60.0))])
def test_a_real_arm_is_found_without_help(
    recording: Recording, arm: Anatomy, frame: int, elbow_deg: tuple[float, float]
):
    cloud = fuse(recording, instants(recording)[frame], region=RIGHT_HALF)
    found = find_pose(make_body(arm), Target(cloud))
    assert found.fit.residual_m < 0.006
    assert found.skin_m < 0.012
    assert found.coverage > 0.85
    assert found.attached < 0.2
    assert found.void < 0.15
    elbow = np.rad2deg(found.fit.theta[arm.coordinate_index("elbow_flexion")])
    assert elbow_deg[0] < elbow < elbow_deg[1]
