"""A real person before one real sensor; the margins are about 1.5 times what was measured."""

from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.match.correspondences import Target
from adapt.model.body import joint_centres, make_body
from adapt.search.first_pose import find_pose
from capture.camera import Camera
from capture.cloud.fuse import fuse
from capture.importers import import_images, natural_order, source_files
from capture.projection import project
from capture.recording import Recording, Region, instants

KINECT = Path(__file__).parents[2] / "shared" / "recordings" / "upperbody_arms_kinect1_skeltrack"
WALKER = Path(__file__).parents[2] / "shared" / "recordings" / "gait_legs_walker"
FLOOR, FLOOR_M = np.array([0.022, 0.790, 0.613]), 0.854  # n . x = d, measured once
RIGHT_AND_LEFT = [  # which of FRAMES, where the leg is, and where motion capture has its ankle
    ("right", 0, (-0.19, 0.015), (309.0, 278.0)),
    ("left", 1, (0.005, 0.19), (350.0, 153.0)),
]
RIGHT_HALF = Region(np.array([-0.75, -0.6, 0.5]), np.array([0.02, 0.7, 1.7]))

on_kinect = pytest.mark.skipif(not KINECT.is_dir(), reason="the real recording is not at hand")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    camera = Camera(640, 480, 585.0, 585.0, 319.5, 239.5)
    files = natural_order(source_files(KINECT, "depth-data-*"))
    return import_images(
        files, tmp_path_factory.mktemp("real") / "rec", kind="raw", camera=camera, depth_unit_m=0.001, fps=1.0
    )


@on_kinect
@pytest.mark.parametrize(("frame", "elbow_deg"), [(7, (10.0, 50.0)), (10, (10.0, 60.0))])
def test_a_real_arm_is_found_without_help(
    recording: Recording, arm: Anatomy, frame: int, elbow_deg: tuple[float, float]
):
    cloud = fuse(recording, instants(recording)[frame], region=RIGHT_HALF)
    found = find_pose(make_body(arm), Target(cloud))
    assert found.fit.residual_m < 0.006
    assert found.skin_m < 0.012
    assert found.coverage > 0.85
    assert found.merged_outline < 0.2
    assert found.free_space < 0.15
    elbow = np.rad2deg(found.fit.theta[arm.coordinate_index("elbow_flexion")])
    assert elbow_deg[0] < elbow < elbow_deg[1]


# ---- legs seen from a walking frame: shanks and feet of somebody in jeans and shoes, on the floor

FRAMES = (30, 50)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    camera = Camera(640, 480, 570.0, 570.0, 319.5, 239.5)
    files = [WALKER / "gait_depth" / f"gait_depth_60frames_{frame}.png" for frame in FRAMES]
    return import_images(files, tmp_path_factory.mktemp("walk") / "rec", kind="png", camera=camera, depth_unit_m=0.001)


@pytest.mark.skipif(not WALKER.is_dir(), reason="the real recording is not at hand")
@pytest.mark.parametrize(("side", "number", "x_m", "ankle_px"), RIGHT_AND_LEFT)
def test_a_real_leg_is_found_by_its_shank_and_foot_alone(
    walk: Recording, side: str, number: int, x_m: tuple[float, float], ankle_px: tuple[float, float]
):
    region = Region(np.array([x_m[0], -0.6, 0.6]), np.array([x_m[1], 0.24, 1.7]))
    cloud = fuse(walk, instants(walk)[number], region=region)
    assert np.mean(np.abs(cloud.points @ FLOOR - FLOOR_M) < 0.015) < 0.01, "the floor is in the cloud"
    body = make_body(load_anatomy(f"lower-limb-{side}"))
    found = find_pose(body, Target(cloud))
    assert found.fit.residual_m < 0.005
    assert found.skin_m < 0.014
    assert found.coverage > 0.85
    assert found.merged_outline < 0.2
    assert found.free_space < 0.15
    view = cloud.views[0]
    (ankle,), _ = project(view.camera, joint_centres(body, found.fit.theta)["ankle"][None])
    assert np.linalg.norm(ankle - ankle_px) < 70.0
