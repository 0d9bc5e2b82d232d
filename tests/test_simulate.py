"""A simulated recording shows what is there, from where the truth says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from capture.camera import backproject
from capture.errors import BonetrackError, RecordingError
from capture.projection import project
from capture.recording import open_recording, read_depth
from capture.rigid import apply, inverse
from capture.simulation.mesh_axes import MeshAxes
from capture.simulation.mesh_file import simulate_mesh_file
from capture.simulation.ray_casting import cast, scene_of
from capture.simulation.rig import RigSensor, SensorRig, box_mesh, default_rig
from capture.simulation.sensor import NoiseModel, carmine_camera
from capture.simulation.simulate import simulate_recording
from tests.moving_arm import arm_motion

EXACT = NoiseModel()


def sphere(radius: float, *, rings: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """A fine sphere about the origin."""
    polar, around = np.linspace(0.0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings
    p, a = np.meshgrid(polar, around, indexing="ij")
    points = radius * np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij"))
    width = 2 * rings
    q, r = i * width + j, i * width + (j + 1) % width
    return points, np.concatenate([np.column_stack([q, q + width, r]), np.column_stack([r, q + width, r + width])])


def test_depth_is_the_z_of_the_surface_in_the_sensors_frame() -> None:
    vertices, faces = sphere(0.1)
    rig = default_rig(vertices)
    sensor = rig.sensors[0]
    view = cast(scene_of(vertices, faces), sensor.camera, sensor.world_from_sensor, vertices, 0.0)
    seen = backproject(sensor.camera, view.depth)
    world = apply(sensor.world_from_sensor, seen[np.isfinite(seen[..., 2])])
    radii = np.linalg.norm(world, axis=1)
    assert len(world) > 3000
    assert radii.max() < 0.1 + 1e-6
    assert radii.min() > 0.1 * np.cos(np.pi / 40) ** 2 - 1e-6
    row, column = np.unravel_index(view.normal_cos.argmax(), view.depth.shape)
    assert np.hypot(row - sensor.camera.cy, column - sensor.camera.cx) < 8.0  # it looks at the centre
    assert not view.shadow.any()


def test_the_projector_casts_a_shadow_on_the_side_away_from_it() -> None:
    near, faces = box_mesh((0.1, 0.4, 0.02))
    far, _ = box_mesh((1.0, 1.0, 0.02))
    vertices = np.vstack([near + np.array([0.0, 0.0, 0.8]), far + np.array([0.0, 0.0, 1.2])])
    both = np.vstack([faces, faces + 8])
    camera = carmine_camera()
    view = cast(scene_of(vertices, both), camera, np.eye(4), vertices, 0.075)
    columns = np.flatnonzero(view.shadow[int(camera.cy)])
    left_edge = camera.cx - 0.05 / 0.79 * camera.fx
    # The shadow's width in pixels is the difference of the disparities of the two surfaces.
    expected = camera.fx * 0.075 * (1.0 / 0.79 - 1.0 / 1.19)
    assert len(columns) == pytest.approx(expected, abs=1.5)
    assert columns.max() == pytest.approx(left_edge, abs=1.5)


def test_the_default_rig_sees_the_whole_motion_and_three_faces_of_the_box_from_each_sensor() -> None:
    frames, _, _ = arm_motion(6)
    points = np.concatenate(frames) + np.array([3.0, -1.0, 2.0])
    for seed in range(5):
        rig = default_rig(points, seed=seed)
        corners = apply(rig.world_from_box, box_mesh(rig.box_size_m)[0])
        for sensor in rig.sensors:
            for seen in (points, corners):
                pixels, depth = project(sensor.camera, apply(inverse(sensor.world_from_sensor), seen))
                assert ((pixels > 0.0) & (pixels < (639.0, 479.0))).all()
                assert depth.min() > 0.35
            eye = apply(inverse(rig.world_from_box), sensor.world_from_sensor[None, :3, 3])[0]
            assert np.min(np.abs(eye) / np.linalg.norm(eye)) > 0.3
        a, b = (s.world_from_sensor[:3, 3] - points.mean(axis=0) for s in rig.sensors)
        assert 60.0 < np.rad2deg(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))) < 100.0
        assert abs(a[1] - b[1]) > 0.1


def test_a_motion_too_large_for_the_sensors_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"does not fit.*metres"):
        default_rig(np.array([[0.0, 0.0, 0.0], [600.0, 300.0, 200.0]]))


def test_a_recording_tells_the_truth_about_itself(tmp_path: Path) -> None:
    frames, faces, times = arm_motion(3)
    done: list[int] = []
    recording = simulate_recording(
        tmp_path / "rec",
        frames,
        faces,
        times,
        noise=EXACT,
        box_frames=2,
        truth={"flexion_deg": np.array([1.0, 2.0, 3.0])},
        progress=done.append,
    )
    assert done == [1, 2, 3]
    assert recording.box_size_m == (0.30, 0.20, 0.15)
    assert recording.truth_path is not None
    with np.load(recording.truth_path, allow_pickle=False) as truth:
        assert truth["times_s"].tolist() == times
        assert truth["flexion_deg"].tolist() == [1.0, 2.0, 3.0]
        poses = dict(zip(truth["sensor_names"].tolist(), truth["world_from_sensor"], strict=True))
        world_from_box = truth["world_from_box"]
    for sensor in recording.sensors:
        assert (len(sensor.frames), len(sensor.box_frames)) == (3, 2)
        for frame, vertices in zip(sensor.frames, frames, strict=True):
            seen = backproject(sensor.camera, read_depth(sensor, frame))
            world = apply(poses[sensor.name], seen[np.isfinite(seen[..., 2])])
            assert len(world) > 3000
            assert cKDTree(vertices).query(world)[0].max() < 0.03  # vertices stand about 25 mm apart
        seen = backproject(sensor.camera, read_depth(sensor, sensor.box_frames[0]))
        on_box = apply(inverse(world_from_box) @ poses[sensor.name], seen[np.isfinite(seen[..., 2])])
        outside = np.abs(np.abs(on_box) / (0.15, 0.10, 0.075)).max(axis=1)
        assert np.abs(outside - 1.0).max() < 0.01


def test_frames_are_taken_one_by_one_when_the_rig_is_given(tmp_path: Path) -> None:
    frames, faces, times = arm_motion(3)
    taken: list[int] = []

    def stream() -> Iterator[np.ndarray]:
        for index, vertices in enumerate(frames):
            taken.append(index)
            yield vertices

    order: list[tuple[int, int]] = []
    simulate_recording(
        tmp_path / "rec",
        stream(),
        faces,
        times,
        rig=default_rig(np.concatenate(frames)),
        box_frames=1,
        progress=lambda done: order.append((done, len(taken))),
    )
    assert order == [(1, 1), (2, 2), (3, 3)]


def test_a_clock_offset_shows_in_the_time_stamps_only(tmp_path: Path) -> None:
    frames, faces, times = arm_motion(2)
    rig = default_rig(np.concatenate(frames))
    late = RigSensor("late", rig.sensors[1].camera, rig.sensors[1].world_from_sensor, clock_offset_s=0.008)
    recording = simulate_recording(
        tmp_path / "rec",
        frames,
        faces,
        times,
        rig=SensorRig((rig.sensors[0], late), rig.world_from_box),
        box_frames=1,
    )
    stamps = [frame.time_s for frame in recording.sensor("late").frames]
    assert stamps == pytest.approx([t + 0.008 for t in times])
    assert [frame.time_s for frame in recording.sensor("sensor1").frames] == times


def test_the_same_seed_gives_the_same_recording_and_another_seed_another(tmp_path: Path) -> None:
    frames, faces, times = arm_motion(1)
    first, again, other = (
        simulate_recording(tmp_path / name, frames, faces, times, seed=seed, box_frames=1)
        for name, seed in (("a", 1), ("b", 1), ("c", 2))
    )

    def image(recording_path: Path) -> bytes:
        return open_recording(recording_path).sensors[0].frames[0].path.read_bytes()

    assert image(first.path) == image(again.path)
    assert image(first.path) != image(other.path)


def test_a_mesh_file_becomes_a_recording(tmp_path: Path) -> None:
    frames, faces, _ = arm_motion(3)
    mesh = tmp_path / "arm.npz"
    np.savez(mesh, vertices=np.stack(frames).astype(np.float32), faces=faces.astype(np.int32), fps=30)
    recording = simulate_mesh_file(mesh, tmp_path / "rec")
    assert [frame.time_s for frame in recording.sensors[0].frames] == pytest.approx([0.0, 1 / 30, 2 / 30])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"faces": None}, "has no faces"),
        ({"fps": 0.0}, "fps must be one positive number"),
        ({"fps": [30.0, 60.0]}, "fps must be one positive number"),
        ({"vertices": np.zeros((8, 3))}, r"vertices must be floating point numbers \(T, V, 3\)"),
        ({"vertices": np.zeros((2, 8, 3), dtype=int)}, "vertices must be floating point"),
        ({"vertices": np.full((2, 8, 3), np.nan)}, "not finite"),
        ({"faces": np.array([[0, 1, 99]])}, "faces name vertex 99, and there are 8"),
        ({"faces": np.array([[0.0, 1.0, 2.0]])}, "faces must be whole numbers"),
        ({"faces": np.array([[0, 1, -2]])}, "faces must be whole numbers"),
    ],
)
def test_a_bad_mesh_file_is_refused_by_name(tmp_path: Path, change: dict[str, object], message: str) -> None:
    vertices, faces = box_mesh((0.2, 0.2, 0.2))
    content = {"vertices": np.stack([vertices, vertices]), "faces": faces, "fps": 30.0} | change
    mesh = tmp_path / "bad.npz"
    np.savez(mesh, **{key: np.asarray(value) for key, value in content.items() if value is not None})
    with pytest.raises(RecordingError, match=message) as caught:
        simulate_mesh_file(mesh, tmp_path / "rec")
    assert caught.value.where == str(mesh)
    with pytest.raises(BonetrackError):
        open_recording(tmp_path / "rec")


def standing_block(tmp_path: Path, *, turn: np.ndarray | None = None, inwards: bool = False) -> Path:
    """A block of 0.3 (forward) x 0.6 (up) x 0.1 m (right) as a mesh file, in axes whose rows are ``turn``."""
    vertices, faces = box_mesh((0.3, 0.6, 0.1))
    vertices = vertices if turn is None else vertices @ turn.T
    path = tmp_path / "block.npz"
    np.savez(path, vertices=vertices[None], faces=faces[:, ::-1] if inwards else faces, fps=30.0)
    return path


BLENDER = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # x left, y backward, z up


def test_a_mesh_that_lies_is_refused_until_its_axes_are_stated(tmp_path: Path) -> None:
    lying = standing_block(tmp_path, turn=BLENDER)
    with pytest.raises(RecordingError, match=r"seems to lie: it is 0\.30 m along Y.*0\.60 m along Z.*--up") as caught:
        simulate_mesh_file(lying, tmp_path / "rec")
    assert caught.value.where == str(lying)
    simulate_mesh_file(lying, tmp_path / "as-it-is", axes=MeshAxes("+y", "+x"))
    simulate_mesh_file(lying, tmp_path / "stood-up", axes=MeshAxes("+z", "-y"), noise=EXACT)
    simulate_mesh_file(standing_block(tmp_path), tmp_path / "standing", noise=EXACT)
    images = [open_recording(tmp_path / name).sensors[0].frames[0].path for name in ("stood-up", "standing")]
    assert images[0].read_bytes() == images[1].read_bytes()


def test_a_mesh_that_would_be_seen_from_the_inside_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="face inwards"):
        simulate_mesh_file(standing_block(tmp_path, inwards=True), tmp_path / "rec")
    mirrored = standing_block(tmp_path, turn=np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(RecordingError, match="face inwards"):
        simulate_mesh_file(mirrored, tmp_path / "rec", axes=MeshAxes("+y", "+x"))


def test_a_sheet_that_encloses_nothing_is_neither_inside_out_nor_lying(tmp_path: Path) -> None:
    sheet = np.array([[[0.0, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.3], [0.0, 0.4, 0.3]]])
    for name, faces in (("one", [[0, 1, 2], [1, 3, 2]]), ("other", [[0, 2, 1], [1, 2, 3]])):
        np.savez(tmp_path / f"{name}.npz", vertices=sheet, faces=np.array(faces), fps=30.0)
        simulate_mesh_file(tmp_path / f"{name}.npz", tmp_path / name)


@pytest.mark.parametrize("up", "xyz")
@pytest.mark.parametrize("forward", "xyz")
def test_stated_axes_turn_a_mesh_and_never_mirror_it(up: str, forward: str) -> None:
    if up == forward:
        with pytest.raises(RecordingError, match="the same axis"):
            MeshAxes(f"-{up}", f"+{forward}")
        return
    for signs in ("++", "+-", "-+", "--"):
        axes = MeshAxes(signs[0] + up, signs[1] + forward)
        turn = axes.turned(np.eye(3)).T
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert turn[1] @ np.eye(3)["xyz".index(up)] == (1.0 if signs[0] == "+" else -1.0)
        assert turn[0] @ np.eye(3)["xyz".index(forward)] == (1.0 if signs[1] == "+" else -1.0)


def test_an_axis_that_is_none_is_refused_by_name() -> None:
    with pytest.raises(RecordingError, match=r"no axis is called 'w'.*\+x, -x"):
        MeshAxes("w", "x")


def test_a_file_that_is_no_mesh_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "mesh.npz"
    text.write_text("hello")
    with pytest.raises(RecordingError, match=r"not an \.npz file"):
        simulate_mesh_file(text, tmp_path / "rec")
    with pytest.raises(RecordingError, match="does not exist"):
        simulate_mesh_file(tmp_path / "none.npz", tmp_path / "rec")


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_mesh_file_is_refused_in_one_line(tmp_path: Path, share: float) -> None:
    frames, faces, _ = arm_motion(3)
    mesh = tmp_path / "cut.npz"
    np.savez_compressed(mesh, vertices=np.stack(frames), faces=faces, fps=30)
    data = mesh.read_bytes()
    mesh.write_bytes(data[: int(share * len(data))])
    with pytest.raises(RecordingError, match=r"cut\.npz: is not an \.npz file") as caught:
        simulate_mesh_file(mesh, tmp_path / "rec")
    assert "\n" not in str(caught.value)


def test_a_damaged_mesh_file_is_refused_in_one_line(tmp_path: Path) -> None:
    frames, faces, _ = arm_motion(3)
    mesh = tmp_path / "damaged.npz"
    np.savez_compressed(mesh, vertices=np.stack(frames), faces=faces, fps=30)
    data = bytearray(mesh.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 50] = bytes(50)
    mesh.write_bytes(data)
    with pytest.raises(RecordingError, match=r"damaged\.npz: is not an \.npz file"):
        simulate_mesh_file(mesh, tmp_path / "rec")


def test_as_many_times_as_frames_are_needed(tmp_path: Path) -> None:
    frames, faces, times = arm_motion(3)
    for given in (times[:2], [*times, 1.0]):
        with pytest.raises(RecordingError, match="as many times as frames"):
            simulate_recording(tmp_path / "rec", frames, faces, given, box_frames=1, overwrite=True)


def test_the_faces_of_the_box_look_outwards() -> None:
    vertices, faces = box_mesh((0.3, 0.2, 0.1))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert ((normals * (a + b + c)).sum(axis=1) > 0.0).all()
    assert np.linalg.norm(normals, axis=1).sum() / 2.0 == pytest.approx(2 * (0.06 + 0.03 + 0.02))
