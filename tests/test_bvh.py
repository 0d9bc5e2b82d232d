"""Exported BVH files in two readers, bvhio and bvhtoolbox: joints stand where ours do, and gaps are what was asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.model.body import bone_transforms, joint_centres, rest_theta
from capture.errors import OutputError
from capture.rigid import apply
from tests.holey_limb import KNOWN, UP, HoleyLimb, holey
from tests.test_export_readers import LOST
from track.export.bvh import write_bvh
from track.motion import MotionError

__all__ = ["holey"]

FIRST = KNOWN[0]
AGREE_M = 3e-4  # three joints of a tenth of a millimetre each


def pivots(limb: HoleyLimb, t: int) -> dict[str, np.ndarray]:
    """Where each bone carries the joint that it hangs on (3,) m in frame t, y up."""
    rest, moved = joint_centres(limb.body, rest_theta(limb.body)), bone_transforms(limb.body, limb.motion.thetas[t])
    return {
        joint.child: limb.turned(apply(moved[joint.child], rest[joint.name][None])[0])
        for joint in limb.body.anatomy.joints
    }


def read_by_bvhio(path):
    """Places (m) by frame and joint."""
    bvhio = pytest.importorskip("bvhio", reason="reads BVH files in tests")
    root = bvhio.readAsHierarchy(str(path))
    frames = []
    for k in range(bvhio.readAsBvh(str(path)).FrameCount):
        root.loadPose(k)
        frames.append({node.Name: np.array(node.PositionWorld) / 100.0 for node, _, _ in root.layout()})
    return frames


def read_by_bvhtoolbox(path):
    """The same by another reader, which leaves it to us to put joints behind each other."""
    toolbox = pytest.importorskip("bvhtoolbox", reason="reads BVH files in tests")
    tree = toolbox.BvhTree(path.read_text())
    worlds: dict[str, np.ndarray] = {}
    for joint in tree.get_joints():
        local = toolbox.get_affines(tree, joint.name, axes="rzxy")
        if "Xposition" not in joint["CHANNELS"]:
            local[:, :3, 3] = [float(part) for part in joint["OFFSET"]]
        parent = tree.joint_parent(joint.name)
        worlds[joint.name] = local if parent is None else worlds[parent.name] @ local
    return [{name: world[k, :3, 3] / 100.0 for name, world in worlds.items()} for k in range(tree.nframes)]


@pytest.mark.parametrize("read", [read_by_bvhio, read_by_bvhtoolbox])
def test_joints_stand_where_ours_do_in_every_frame_that_was_tracked(holey, read, tmp_path):
    report = write_bvh(holey.motion, holey.subject, tmp_path / "motion.bvh", up=UP, gaps="bridge")
    frames = read(tmp_path / "motion.bvh")
    assert (len(frames), report.filled, report.left_out) == (KNOWN[-1] - FIRST + 1, 1, 2)
    for t in KNOWN:
        for bone, at in pivots(holey, t).items():
            np.testing.assert_allclose(frames[t - FIRST][bone], at, atol=AGREE_M, err_msg=f"{bone} in frame {t}")


def test_a_lost_frame_is_moved_over_evenly_or_is_the_pose_before_or_ends_a_file(holey, tmp_path):
    lost = LOST[1]
    root = holey.body.anatomy.joints[0].child
    before, after = pivots(holey, lost - 1)[root], pivots(holey, lost + 1)[root]
    for gaps, between in (("bridge", (before + after) / 2.0), ("hold", before)):
        write_bvh(holey.motion, holey.subject, tmp_path / "motion.bvh", up=UP, gaps=gaps)
        np.testing.assert_allclose(read_by_bvhio(tmp_path / "motion.bvh")[lost - FIRST][root], between, atol=AGREE_M)
    report = write_bvh(holey.motion, holey.subject, tmp_path / "span.bvh", up=UP, gaps="split")
    assert [path.name for path in report.paths] == ["span_1.bvh", "span_2.bvh"]
    assert (report.filled, report.left_out) == (0, 3)
    spans = [read_by_bvhio(path) for path in report.paths]
    assert [len(span) for span in spans] == [lost - FIRST, KNOWN[-1] - lost]
    np.testing.assert_allclose(spans[1][0][root], after, atol=AGREE_M)


def test_without_a_word_about_gaps_a_motion_with_lost_frames_is_refused(holey, tmp_path):
    with pytest.raises(MotionError, match=r"1 lost frame.*--gaps bridge .*hold .*split"):
        write_bvh(holey.motion, holey.subject, tmp_path / "motion.bvh", up=UP)
    assert not list(tmp_path.iterdir())


def test_lost_frames_at_the_ends_alone_are_cut_off(holey, tmp_path):
    motion = holey.motion
    names = ("times", "thetas", "deviations", "lost", "residuals", "coverage", "matches", "shown")
    some = replace(motion, **{name: getattr(motion, name)[:4] for name in names})
    report = write_bvh(some, holey.subject, tmp_path / "motion.bvh", up=UP)
    assert (report.filled, report.left_out, len(read_by_bvhio(tmp_path / "motion.bvh"))) == (0, 1, 3)


def test_a_file_of_other_programs_is_not_replaced(holey, tmp_path):
    path = tmp_path / "motion.bvh"
    write_bvh(holey.motion, holey.subject, path, up=UP, gaps="hold")
    write_bvh(holey.motion, holey.subject, path, up=UP, gaps="hold")
    path.write_text(path.read_text().replace("  \n", "\n"))
    with pytest.raises(OutputError, match="not replaced"):
        write_bvh(holey.motion, holey.subject, path, up=UP, gaps="hold")
