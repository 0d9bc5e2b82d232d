from __future__ import annotations

import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.subject import save_subject
from tests.known_limb import KnownLimb
from tests.known_motion import HIDDEN, WHY, known_motion, reported_subject

pytest.importorskip("plotly", reason="plotly is not installed (extra: view)")

from track.about import About, read_about
from track.cli import bonetrack
from track.motion import save_motion
from track.settings import Settings
from track.view.page import ReportError
from track.view.report import write_report
from track.view.report_charts import angle_chart
from track.view.scene import motion_scene, runs


class _Page(HTMLParser):
    """What a page asks a browser for, and what it tells those who do not see its pictures."""

    def __init__(self) -> None:
        super().__init__()
        self.resources: list[str] = []
        self.pictures: list[str] = []
        self.charts: list[str] = []
        self.cells: list[str] = []
        self.text: list[str] = []
        self.language = ""
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self._inside = tag
        self.resources += [given[name] for name in ("src", "href", "data", "srcset", "action") if name in given]
        if tag == "html":
            self.language = given.get("lang", "")
        if tag == "img":
            self.pictures.append(given.get("alt", ""))
        if given.get("role") == "img":
            self.charts.append(given.get("aria-label", ""))

    def handle_data(self, data: str) -> None:
        if self._inside not in ("script", "style"):
            self.text.append(data)


@pytest.fixture(scope="module")
def report(limb: KnownLimb, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(known_motion(limb), reported_subject(limb), limb.recording, path, title="a <b> motion")
    return path


@pytest.fixture(scope="module")
def read(report: Path) -> _Page:
    page = _Page()
    page.feed(report.read_text(encoding="utf-8"))
    return page


def test_the_page_stands_alone(read: _Page) -> None:
    assert read.resources
    assert all(address.startswith(("#", "data:")) for address in read.resources)


def test_pictures_and_charts_are_told_in_words(read: _Page) -> None:
    assert read.language == "en"
    assert len(read.pictures) == 1
    assert len(read.charts) == 3
    assert all(len(words) > 20 for words in [*read.pictures, *read.charts])


def test_the_page_says_who_how_well_how_far_and_what_was_lost(read: _Page) -> None:
    text = " ".join(" ".join(read.text).split())
    for words in (
        "10 of 12 frames tracked",
        "1.20 mm apart",
        "Lengths of bones",
        "Girths of the limb",
        "812",  # matches of the example pose
        "olecranon",  # never shown
        "± 1.5",  # the deviation in the table of ranges
        WHY,
        "hand 1 0.27 to 0.27",  # the bone out of sight
        "Errors against the truth",
        "research software, not a medical device",
    ):
        assert words in text, words
    assert "a <b> motion" in text  # told as it is, not taken for a tag


def test_the_ranges_are_those_of_the_frames_that_are_known(limb: KnownLimb, read: _Page) -> None:
    motion = known_motion(limb)
    i = motion.coordinates.index("elbow_flexion")
    low, high = np.rad2deg([np.nanmin(motion.thetas[:, i]), np.nanmax(motion.thetas[:, i])])
    text = " ".join(" ".join(read.text).split())
    assert f"elbow flexion (deg) elbow_flexion {low:.1f} ± 1.5" in text
    assert f"{high:.1f} ± 1.5" in text
    assert f"{high - low:.1f}" in text


def test_the_first_section_is_for_whoever_treats_the_person(limb: KnownLimb, tmp_path: Path) -> None:
    motion, about = known_motion(limb), About("Arm after week 6", "P07 <x>", "week 6", "wrist taped & sore")
    write_report(motion, reported_subject(limb), None, tmp_path / "r.html", title="motion", about=about)
    page = _Page()
    page.feed((tmp_path / "r.html").read_text(encoding="utf-8"))
    text = " ".join(" ".join(page.text).split())
    first = text[: text.index("Lengths of bones")]
    degrees = np.rad2deg(motion.thetas[:, motion.coordinates.index("elbow_flexion")])
    for words in (
        "Arm after week 6",
        "Person: P07 <x> Session: week 6 Limb: right arm",
        "wrist taped & sore",
        "83 % of the recording could be followed.",
        "1.2 mm from what the sensors saw (median).",
        "Angles are stated to be within 3.0 to 3.0 degrees, 19 times in 20.",
        f"elbow flexion (deg) {np.nanmin(degrees):.0f} ± 3 {np.nanmax(degrees):.0f} ± 3",
        "-2 to 146 the straight arm",
        "Zwerus et al. 2019",
        "2 of 12 frames: only … % of the skin that should show was found.",
        "The hand was out of sight in 1 more frames; nothing is said of it there.",
    ):
        assert words in first, words


def test_a_report_that_knows_of_nobody_leaves_the_person_out(read: _Page) -> None:
    text = " ".join(" ".join(read.text).split())
    assert "Limb: right arm" in text
    assert "Person:" not in text


def test_what_the_command_is_told_of_the_person_stays_with_the_motion(limb: KnownLimb, tmp_path: Path) -> None:
    (tmp_path / "motion").mkdir()
    save_motion(known_motion(limb), tmp_path / "motion")
    save_subject(reported_subject(limb), tmp_path / "s.npz")
    command = ["report", str(tmp_path / "motion"), "--subject", str(tmp_path / "s.npz"), "--out"]
    told = CliRunner().invoke(bonetrack, [*command, str(tmp_path / "one.html"), "--person", "P07", "--note", "taped"])
    assert told.exit_code == 0, told.output
    again = CliRunner().invoke(bonetrack, [*command, str(tmp_path / "two.html"), "--session", "before"])
    assert again.exit_code == 0, again.output
    assert read_about(tmp_path / "motion") == About(person="P07", session="before", note="taped")
    page = (tmp_path / "two.html").read_text(encoding="utf-8")
    assert all(words in page for words in ("P07", "before", "taped"))


def test_the_bands_are_one_and_two_deviations_and_leave_out_what_is_not_known(limb: KnownLimb) -> None:
    motion = known_motion(limb)
    figure = angle_chart(motion_scene(motion, limb.subject, None, title="motion"))
    narrow, angle = (next(t for t in figure.data if t.name == name) for name in ("± 1 SD", "tracked"))
    wide = next(t for t in figure.data if t.name == "± 2 SD")
    x, y = np.array(wide.x), np.array(wide.y)
    assert not np.isin(motion.times[[4, 5]], x).any()
    at = y[x == motion.times[2]]
    middle = np.array(angle.y)[2]
    assert np.sort(at) == pytest.approx([middle - 3.0, middle + 3.0])
    assert np.ptp(np.array(narrow.y)[np.array(narrow.x) == motion.times[2]]) == pytest.approx(3.0)
    assert np.isnan(np.array(angle.y)[[4, 5]]).all()
    wrist = next(t for t in figure.data if t.name == "tracked" and t.yaxis == "y4")
    assert np.isnan(np.array(wrist.y)[[4, 5, HIDDEN]]).all()
    assert np.isfinite(np.array(angle.y)[HIDDEN])


def test_without_a_recording_there_are_no_errors(limb: KnownLimb, tmp_path: Path) -> None:
    write_report(known_motion(limb), reported_subject(limb), None, tmp_path / "r.html", title="motion")
    assert "Errors against the truth" not in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_the_page_tells_versions_and_settings(limb: KnownLimb, tmp_path: Path) -> None:
    settings = Settings(
        {"bonetrack": "0.0.9", "numpy": "2.0.1"},
        {"region": "given", "region_minimum_m": [-0.25, 0.0, 0.5], "region_maximum_m": [0.25, 1.0, 1.5]}
        | {"poses_by_hand": [{"name": "start", "frame": 3}], "world_from_thorax": None},
        {"largest_residual_m": 0.006},
    )
    subject = reported_subject(limb)
    adapted = {"versions": {"bonetrack": "0.0.8"}, "example_poses": 6, "frames_given": None}
    subject = replace(subject, report=subject.report | {"settings": adapted})
    write_report(replace(known_motion(limb), settings=settings), subject, None, tmp_path / "r.html", title="motion")
    page = _Page()
    page.feed((tmp_path / "r.html").read_text(encoding="utf-8"))
    text = " ".join(" ".join(page.text).split())
    for words in (
        "subject motion page",
        "bonetrack 0.0.8 0.0.9",
        "numpy 2.0.1",
        "example_poses 6",
        "region given",
        "region_minimum_m -0.25, 0, 0.5",
        "poses_by_hand name start, frame 3",
        "world_from_thorax none",
        "largest_residual_m 0.006",
    ):
        assert words in text, words
    assert "older version" not in text


def test_the_page_says_of_which_results_no_settings_are_known(read: _Page) -> None:
    text = " ".join(" ".join(read.text).split())
    assert "Of the subject and the motion no settings are known" in text


def test_without_plotly_one_line_says_what_to_install(
    limb: KnownLimb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly.subplots", None)
    with pytest.raises(ReportError, match=r"the report needs plotly; pip install 'bonetrack\[view\]'"):
        write_report(known_motion(limb), reported_subject(limb), None, tmp_path / "r.html", title="motion")
    assert not list(tmp_path.iterdir())


def test_runs_are_unbroken() -> None:
    assert runs(np.array([], dtype=bool)) == []
    assert runs(np.array([False, True, True, False, True])) == [slice(1, 3), slice(4, 5)]
