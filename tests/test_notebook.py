"""Motions in a notebook: a tidy table for pandas, a strip of what was tracked, and the scene to turn."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

from tests.known_motion import HIDDEN, LOST, WHY, known_motion
from track.export.tidy import tidy_angles
from track.motion import MotionError
from track.view.notebook import show


def test_a_tidy_table_has_a_row_for_every_frame_and_coordinate_in_units_that_people_read(limb):
    pytest.importorskip("pandas", reason="tidy tables need pandas: pip install bonetrack[pandas]")
    motion = known_motion(limb)
    table = tidy_angles(motion, limb.subject)
    assert len(table) == len(motion.times) * len(motion.coordinates)
    wide = table.pivot(index="frame", columns="coordinate", values="value")
    elbow = motion.coordinates.index("elbow_flexion")
    np.testing.assert_allclose(wide["elbow_flexion"], np.rad2deg(motion.thetas[:, elbow]))
    assert wide["elbow_flexion"].isna().to_numpy().nonzero()[0].tolist() == list(LOST)
    assert wide["flexion"].isna().to_numpy().nonzero()[0].tolist() == [*LOST, HIDDEN]  # the hand's, a guess there
    assert set(table.loc[table.coordinate == "shoulder_tx", "unit"]) == {"m"}
    known = table[(table.coordinate == "pro_sup") & (table.frame == 1)].iloc[0]
    assert (known["unit"], known["sd"]) == ("deg", pytest.approx(1.5))
    assert set(table.loc[table.frame == LOST[0], "lost_because"]) == {WHY}
    assert list(table.groupby("coordinate", observed=True)["value"].max().index) == list(motion.coordinates)


def test_without_pandas_one_line_says_what_to_install(limb, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MotionError, match=r"pip install 'bonetrack\[pandas\]'"):
        tidy_angles(known_motion(limb), limb.subject)


def test_a_notebook_shows_a_strip_with_every_frame_in_it_once(limb):
    html = known_motion(limb)._repr_html_()
    assert "10 of 12 frames tracked" in html
    assert "all bones show: 9" in html
    assert "some do not show: 1" in html
    assert "lost: 2" in html
    bars = sorted((float(x), float(wide)) for x, wide in re.findall(r'<rect x="([\d.]+)" width="([\d.]+)"', html))
    ends = np.cumsum([wide for _, wide in bars])
    np.testing.assert_allclose([x for x, _ in bars[1:]], ends[:-1], atol=0.05)
    assert ends[-1] == pytest.approx(640.0, abs=0.05)


def test_the_scene_stands_in_the_notebook_without_a_server(limb):
    pytest.importorskip("viser", reason="the viewer needs viser: pip install bonetrack[view]")
    html = show(known_motion(limb), limb.subject, title="<walk>")._repr_html_()
    assert html.startswith("<iframe")
    assert html.count('srcdoc="') == 1
    assert html.count('"') < 200  # those of the page inside are escaped
    assert "&amp;lt;walk&amp;gt;" in html
