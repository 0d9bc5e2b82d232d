import numpy as np
import pytest

from capture.cloud.fuse import Region, fuse, spread, write_ply
from capture.errors import CloudError
from capture.recording import instants
from tests.two_sensors import AXIS, HALF_LENGTH, RADIUS, write_limb

EVERYWHERE = Region(np.full(3, -1.0), np.full(3, 1.0))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_limb(tmp_path_factory.mktemp("two") / "rec")


@pytest.fixture(scope="module")
def cloud(recording):
    return fuse(recording, instants(recording)[0], region=EVERYWHERE)


def from_axis(points):
    outward = points - np.outer(points @ AXIS, AXIS)
    distance = np.linalg.norm(outward, axis=1)
    return outward / distance[:, None], distance


def test_both_sensors_agree_on_one_surface(cloud):
    outward, distance = from_axis(cloud.points)
    inner = ~cloud.boundary
    for sensor in (0, 1):
        mine = inner & (cloud.sensor == sensor)
        assert mine.sum() > 200
        assert abs(float((distance - RADIUS)[mine].mean())) < 0.001
    cosine = (cloud.normals * outward).sum(axis=1)[inner]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1)).mean()) < 5.0


def test_the_ends_of_the_scan_are_boundary_and_its_middle_is_not(cloud):
    along = cloud.points @ AXIS
    assert cloud.boundary[np.abs(along) > HALF_LENGTH - 0.004].all()
    facing = np.zeros(len(along), dtype=bool)
    for index, view in enumerate(cloud.views):
        toward = -(cloud.normals @ view.world_from_sensor[:3, 2])
        facing |= (cloud.sensor == index) & (toward > 0.7)
    assert not cloud.boundary[facing & (np.abs(along) < HALF_LENGTH - 0.03)].any()


def test_normals_face_the_sensor_that_saw_the_point(cloud):
    for index, view in enumerate(cloud.views):
        mine = cloud.sensor == index
        to_sensor = view.world_from_sensor[:3, 3] - cloud.points[mine]
        assert ((cloud.normals[mine] * to_sensor).sum(axis=1) > 0.0).all()


def test_the_region_culls(recording):
    region = Region(np.array([0.0, -1.0, -1.0]), np.array([1.0, 1.0, 1.0]))
    cloud = fuse(recording, instants(recording)[0], region=region)
    assert cloud.points[:, 0].min() > -0.002
    near_cut = cloud.points[:, 0] < 0.004
    assert near_cut.any()
    assert cloud.boundary[near_cut].all()


def test_nothing_in_the_region_is_an_error_that_names_the_recording(recording):
    nowhere = Region(np.full(3, 5.0), np.full(3, 6.0))
    with pytest.raises(CloudError, match=r"rec: no sensor saw anything .* region"):
        fuse(recording, instants(recording)[1], region=nowhere)


def test_wider_spacing_gives_fewer_points(recording):
    instant = instants(recording)[0]
    counts = [len(fuse(recording, instant, region=EVERYWHERE, spacing_m=s).points) for s in (0.006, 0.012, 0.024)]
    assert counts[0] > 2 * counts[1] > 4 * counts[2] > 0


def test_the_same_instant_gives_the_same_cloud(recording, cloud):
    again = fuse(recording, instants(recording)[0], region=EVERYWHERE)
    np.testing.assert_array_equal(again.points, cloud.points)
    np.testing.assert_array_equal(again.normals, cloud.normals)


def test_spread_takes_one_point_of_each_cube_the_most_central():
    points = np.array([[0.001, 0.001, 0.001], [0.005, 0.005, 0.005], [0.015, 0.005, 0.005], [-0.004, 0.005, 0.005]])
    np.testing.assert_array_equal(spread(points, spacing_m=0.01), [1, 2, 3])
    assert len(spread(np.zeros((0, 3)), spacing_m=0.01)) == 0


def test_a_written_cloud_is_read_by_open3d(cloud, tmp_path):
    from capture._open3d import open3d

    write_ply(cloud, tmp_path / "cloud.ply")
    read = open3d().t.io.read_point_cloud(str(tmp_path / "cloud.ply"))
    np.testing.assert_allclose(read.point.positions.numpy(), cloud.points, atol=1e-6)
    np.testing.assert_allclose(read.point.normals.numpy(), cloud.normals, atol=1e-6)
    np.testing.assert_array_equal(read.point["boundary"].numpy().ravel(), cloud.boundary)
    np.testing.assert_array_equal(read.point["sensor"].numpy().ravel(), cloud.sensor)
