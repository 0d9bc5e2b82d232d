"""Exported glTF files: other programs read them, and a reader of its own finds the skin and bones where ours are."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapt.anatomy_file import load_anatomy
from adapt.model.body import make_body, pose_skin, posed_bones, rest_theta
from capture.upright import AXES
from tests.known_limb import bent, known_subject
from tests.known_motion import HIDDEN, LOST, known_motion
from tests.toy_anatomy import toy_anatomy
from tests.toy_leg import toy_leg
from track.export.gltf import write_gltf
from track.export.linear_skin import STEPS, linear_skin, skin_gap
from track.motion import Motion, MotionError, bones_and_centres, coordinate_names

DTYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class ReadBack:
    """A glTF file as pygltflib reads it, and posed as the specification says."""

    def __init__(self, path):
        pygltflib = pytest.importorskip("pygltflib", reason="reads glTF files in tests")
        self.gltf = pygltflib.GLTF2().load(str(path))
        self.parent = {child: k for k, node in enumerate(self.gltf.nodes) for child in node.children or []}

    def array(self, index):
        accessor = self.gltf.accessors[index]
        start = self.gltf.bufferViews[accessor.bufferView].byteOffset
        size = SIZES[accessor.type]
        blob = self.gltf.binary_blob()
        return np.frombuffer(blob, DTYPES[accessor.componentType], accessor.count * size, start).reshape(-1, size)

    def node(self, name):
        return next(k for k, node in enumerate(self.gltf.nodes) if node.name == name)

    def channels(self, path):
        """Times and values by node for what is animated."""
        animation = self.gltf.animations[0]
        samplers = {c.target.node: animation.samplers[c.sampler] for c in animation.channels if c.target.path == path}
        return {
            node: (self.array(sampler.input)[:, 0], self.array(sampler.output)) for node, sampler in samplers.items()
        }

    def worlds(self, key):
        """The transform of every node at a key."""
        turns, shifts, scales = (self.channels(path) for path in ("rotation", "translation", "scale"))

        def world(k):
            local = np.eye(4)
            if k in turns:
                local[:3, :3] = Rotation.from_quat(turns[k][1][key]).as_matrix()
                local[:3, 3] = shifts[k][1][key]
                if k in scales:
                    local[:3, :3] *= scales[k][1][key]
            return world(self.parent[k]) @ local if k in self.parent else local

        return [world(k) for k in range(len(self.gltf.nodes))]

    def skin(self, key):
        return self.hung("skin", key)

    def hung(self, name, key):
        """The vertices at a key of a mesh that hangs on joints."""
        node = self.gltf.nodes[self.node(name)]
        attributes = self.gltf.meshes[node.mesh].primitives[0].attributes
        rest, joints = self.array(attributes.POSITION), self.array(attributes.JOINTS_0)
        weights = self.array(attributes.WEIGHTS_0)
        skin = self.gltf.skins[node.skin]
        back = self.array(skin.inverseBindMatrices).reshape(-1, 4, 4).swapaxes(1, 2)
        worlds = self.worlds(key)
        moves = np.array([worlds[joint] for joint in skin.joints]) @ back
        points = np.column_stack([rest, np.ones(len(rest))])
        return np.einsum("vk,vkij,vj->vi", weights, moves[joints], points)[:, :3]

    def bone(self, name, key):
        node = self.node(f"{name}_surface")
        primitive = self.gltf.meshes[self.gltf.nodes[node].mesh].primitives[0]
        world = self.worlds(key)[node]
        return self.array(primitive.attributes.POSITION) @ world[:3, :3].T + world[:3, 3]


@pytest.fixture(scope="module")
def motion(limb):
    return known_motion(limb)


@pytest.fixture(scope="module")
def written(limb, motion, tmp_path_factory):
    path = tmp_path_factory.mktemp("gltf") / "motion.glb"
    return path, write_gltf(motion, limb.subject, path)


def test_a_reader_finds_skin_and_bones_where_ours_are(written, limb, motion):
    read = ReadBack(written[0])
    key, frame = 7, 9  # two frames before it were lost and have no keys
    theta = motion.thetas[frame]
    off = np.linalg.norm(read.skin(key) - pose_skin(limb.subject.body, theta), axis=1)
    assert off.max() < written[1].skin.largest_m + 1e-5 < 1e-3
    for name, surface in posed_bones(limb.subject.body, theta).items():
        np.testing.assert_allclose(read.bone(name, key), surface, atol=1e-5)


@pytest.mark.parametrize("up", ["x", "-x", "-y", "z", "-z"])
def test_what_points_up_in_the_recording_is_y_in_the_file_and_nothing_is_mirrored(limb, motion, tmp_path, up):
    write_gltf(motion, limb.subject, tmp_path / "motion.glb", up=AXES[up])
    read, theta = ReadBack(tmp_path / "motion.glb"), motion.thetas[9]
    skin = pose_skin(limb.subject.body, theta)
    np.testing.assert_allclose(read.skin(7)[:, 1], skin @ AXES[up], atol=1e-3)
    turn, _ = Rotation.align_vectors(read.skin(7) - read.skin(7).mean(axis=0), skin - skin.mean(axis=0))
    np.testing.assert_allclose(turn.apply(skin), read.skin(7), atol=1e-3)


def test_another_reader_finds_the_same_meshes_and_places(written, limb):
    trimesh = pytest.importorskip("trimesh", reason="reads glTF files in tests")
    scene = trimesh.load(written[0])
    assert len(scene.geometry["skin"].vertices) == len(limb.subject.body.v_tilde.value)
    rest = scene.geometry["skin"].vertices
    np.testing.assert_allclose(rest, limb.subject.body.v_tilde.value, atol=1e-6)


def test_a_skeleton_of_more_joints_than_a_byte_counts_keeps_its_joints_apart(tmp_path, monkeypatch):
    body = make_body(toy_anatomy())
    thetas = np.array([rest_theta(body), rest_theta(body)])
    thetas[1, 6:] += 0.2
    subject = known_subject(body, np.zeros((0, thetas.shape[1])), np.zeros(0))
    monkeypatch.setattr("track.export.gltf.linear_skin", partial(linear_skin, steps=300))
    write_gltf(motion_of(subject, thetas), subject, tmp_path / "motion.glb")
    read = ReadBack(tmp_path / "motion.glb")
    assert len(read.gltf.skins[0].joints) > 256
    off = np.linalg.norm(read.skin(1) - pose_skin(body, thetas[1]), axis=1)
    assert off.max() < 1e-3


def test_vertices_hang_on_four_joints_at_most_and_wholly(written):
    read = ReadBack(written[0])
    attributes = read.gltf.meshes[0].primitives[0].attributes
    weights, joints = read.array(attributes.WEIGHTS_0), read.array(attributes.JOINTS_0)
    assert read.gltf.accessors[attributes.WEIGHTS_0].componentType == 5126  # single precision, so nothing is rounded
    total = ((weights[:, 0] + weights[:, 1]) + weights[:, 2]) + weights[:, 3]  # as a reader adds them up
    assert (np.abs(total - 1.0) <= 2e-7 * (weights > 0.0).sum(axis=1)).all()  # what the specification allows
    assert (weights >= 0.0).all()
    assert joints.max() < len(read.gltf.skins[0].joints) == 4 + STEPS - 1
    assert (joints[weights == 0.0] == 0).all()


def test_lost_frames_have_no_keys_and_bones_vanish_where_they_do_not_show(written, motion):
    path, report = written
    read = ReadBack(path)
    kept = np.delete(motion.times, LOST)
    for times, _ in read.channels("rotation").values():
        np.testing.assert_allclose(times, kept - motion.times[0], atol=1e-6)
    scales = {read.gltf.nodes[k].name: values[1][:, 0] for k, values in read.channels("scale").items()}
    assert np.flatnonzero(scales["hand_surface"] == 0.0).tolist() == [*LOST, HIDDEN]
    assert np.flatnonzero(scales["ulna_surface"] == 0.0).tolist() == list(LOST)
    assert set(np.unique(np.concatenate(list(scales.values())))) == {0.0, 1.0}
    assert (report.lost_frames, report.frames_with_hidden_bones) == (len(LOST), 1)
    assert report.worst_frame not in LOST
    assert read.gltf.extras["lost_frames"] == list(LOST)


def test_a_motion_without_a_pose_is_refused(limb, motion, tmp_path):
    lost = replace(motion, lost=("dark",) * len(motion.times))
    with pytest.raises(MotionError, match="no frame was tracked"):
        write_gltf(lost, limb.subject, tmp_path / "motion.glb")
    assert not list(tmp_path.iterdir())


def test_helper_joints_keep_a_twisted_forearm_within_a_millimetre(arm):
    body = make_body(arm)
    twists = np.array([bent(body, 60.0, degrees) for degrees in (-80.0, 0.0, 80.0)])
    assert skin_gap(linear_skin(body, twists), twists).largest_m < 0.001
    assert skin_gap(linear_skin(body, twists), [rest_theta(body)]).largest_m < 1e-6
    assert skin_gap(linear_skin(body, twists, steps=1), twists).largest_m > 0.01  # by the two bones alone


def knee_bends(body, degrees):
    thetas = np.tile(rest_theta(body), (len(degrees), 1))
    thetas[:, body.anatomy.coordinate_index("knee_angle_r")] = np.deg2rad(degrees)
    return thetas


def test_the_hollow_of_a_bent_knee_swells_in_the_file_too(leg, tmp_path):
    """Without twins that swell it is off by more than a centimetre."""
    subject = known_subject(make_body(leg), np.zeros((0, 11)), np.zeros(0))
    thetas = knee_bends(subject.body, np.linspace(0.0, 100.0, 6))
    report = write_gltf(motion_of(subject, thetas), subject, tmp_path / "motion.glb")
    assert report.skin.largest_m < 0.004
    assert report.worst_frame > 0
    off = np.linalg.norm(ReadBack(tmp_path / "motion.glb").skin(4) - pose_skin(subject.body, thetas[4]), axis=1)
    assert off.max() < report.skin.largest_m + 1e-5
    bare = linear_skin(subject.body, thetas[:1])  # at rest nothing swells: all shares are nought
    assert skin_gap(bare, thetas).largest_m > 0.01


def motion_of(subject, thetas):
    """A motion in which everything shows."""
    shown = np.ones((len(thetas), len(subject.anatomy.bones)), dtype=bool)
    transforms, centres = bones_and_centres(subject, thetas, shown)
    number = np.zeros(len(thetas))
    return Motion(
        anatomy=subject.anatomy.name,
        coordinates=coordinate_names(subject.anatomy),
        times=np.arange(len(thetas)) / 30.0,
        thetas=thetas,
        deviations=np.zeros(thetas.shape),
        lost=("",) * len(thetas),
        residuals=number,
        coverage=number,
        matches=number,
        shown=shown,
        transforms=transforms,
        centres=centres,
    )


@pytest.fixture(scope="module")
def leg():
    return load_anatomy("lower-limb-right")


@pytest.mark.parametrize("make", [toy_anatomy, toy_leg], ids=["arm", "leg"])
def test_joints_stand_where_the_model_has_its_bones_and_the_error_is_what_is_stated(make):
    body = make_body(make())
    theta = rest_theta(body)
    theta[6:] += 0.2
    both = np.array([rest_theta(body), theta])
    skin = linear_skin(body, both)
    off = np.linalg.norm(skin.posed(skin.frames(theta)) - pose_skin(body, theta), axis=1)
    gap = skin_gap(skin, both)
    assert gap.largest_m == pytest.approx(off.max())
    assert gap.mean_m == pytest.approx(off.mean() / 2.0, abs=1e-9)
    assert gap.worst_pose == 1
    assert off.max() < 0.005


def test_khronos_validator_accepts_the_file(written):
    node = shutil.which("node")
    script = (
        "const v=require('gltf-validator');const b=require('fs').readFileSync(process.argv[1]);"
        "v.validateBytes(new Uint8Array(b)).then(r=>{console.log(JSON.stringify(r.issues.messages));"
        "process.exit(r.issues.numErrors+r.issues.numWarnings?1:0)})"
    )
    found = node and subprocess.run([node, "-e", "require.resolve('gltf-validator')"], capture_output=True, check=False)
    if not found or found.returncode:
        pytest.skip("needs node and the npm package gltf-validator where node finds it (NODE_PATH)")
    ran = subprocess.run([node, "-e", script, str(written[0])], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
