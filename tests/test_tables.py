"""Tables of a motion say what the motion says, in CSV and in Parquet."""

from __future__ import annotations

import csv
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.known_motion import BONES, HIDDEN, LOST, known_motion
from track.export.files import export_motion
from track.export.tables import motion_tables, write_parquet
from track.motion import MotionError


@pytest.fixture(scope="module")
def motion(limb):
    return known_motion(limb)


def test_the_table_of_bones_takes_rest_surfaces_to_their_poses(limb, motion, tmp_path):
    export_motion(motion, limb.subject, tmp_path)
    with (tmp_path / "bones.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(motion.times) * len(BONES)
    for row in rows:
        frame = int(row["frame"])
        known = motion.transforms[row["bone"]][frame]
        assert row["shows"] == str(int(frame not in LOST and (frame, row["bone"]) != (HIDDEN, "hand")))
        turn = np.array([float(row[f"q{c}"]) for c in "xyzw"])
        shift = np.array([float(row[f"t{c}_m"]) for c in "xyz"])
        if row["shows"] == "0":
            assert np.isnan([*turn, *shift]).all()
            continue
        np.testing.assert_allclose(Rotation.from_quat(turn).as_matrix(), known[:3, :3], atol=1e-7)
        np.testing.assert_allclose(shift, known[:3, 3], atol=1e-7)


def test_centres_and_angles_have_a_row_a_frame(limb, motion, tmp_path):
    export_motion(motion, limb.subject, tmp_path)
    for name in ("angles", "centres"):
        with (tmp_path / f"{name}.csv").open(newline="") as file:
            times = [float(row["time_s"]) for row in csv.DictReader(file)]
        np.testing.assert_allclose(times, motion.times, atol=1e-8)
    centre = motion_tables(motion, limb.subject.anatomy)["centres"]["elbow_y_m"]
    np.testing.assert_array_equal(centre, motion.centres["elbow"][:, 1])


def test_parquet_says_the_same_and_nulls_what_is_not_known(limb, motion, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="Parquet needs pyarrow")
    written = export_motion(motion, limb.subject, tmp_path, parquet=True)
    for name, table in motion_tables(motion, limb.subject.anatomy).items():
        assert tmp_path / f"{name}.parquet" in written
        read = parquet.read_table(tmp_path / f"{name}.parquet")
        assert read.column_names == list(table)
        for column, values in table.items():
            if values.dtype.kind != "f":
                assert read[column].to_pylist() == values.tolist()
                continue
            back = np.array([np.nan if v is None else v for v in read[column].to_pylist()])
            np.testing.assert_array_equal(back, values)
            assert read[column].null_count == np.isnan(values).sum()


def test_without_pyarrow_one_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MotionError, match=r"bonetrack\[tables\]"):
        write_parquet(tmp_path / "a.parquet", {"time_s": np.zeros(2)})
    assert not list(tmp_path.iterdir())
