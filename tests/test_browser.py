"""Viewer, scene file and report in a real browser: they open, move in time, tell angles, and draw something."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.known_limb import KnownLimb
from tests.known_motion import known_motion, reported_subject
from track.view.scene import Scene, motion_scene

pytest.importorskip("selenium", reason="selenium is not installed (extra: test)")
pytest.importorskip("viser", reason="viser is not installed (extra: view)")
pytest.importorskip("plotly", reason="plotly is not installed (extra: view)")
for _program in ("chromium", "chromedriver"):
    if shutil.which(_program) is None:
        pytest.skip(f"{_program} is not installed (Debian: chromium, chromium-driver)", allow_module_level=True)

from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

from track.view.embedded import write_embedded  # noqa: E402
from track.view.report import write_report  # noqa: E402
from track.view.viewer import Viewer, start_server  # noqa: E402

_PORT = 18740
_PATIENCE_S = 40.0  # a software renderer on a busy machine is slow


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from docs.figures.browser import open_browser

    with open_browser(tmp_path_factory.mktemp("browser"), width=960, height=600) as driver:
        yield driver


@pytest.fixture(scope="module")
def scene(limb: KnownLimb) -> Scene:
    return motion_scene(known_motion(limb), limb.subject, limb.recording, title="motion")


def _wait(found: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline:
        value = found()
        if value:
            return value
        time.sleep(0.2)
    raise AssertionError(f"{what} did not come in {_PATIENCE_S:.0f} s")


def _picture(browser: Any) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(browser.get_screenshot_as_png(), np.uint8), cv2.IMREAD_COLOR)


def _drawn(image: np.ndarray) -> float:
    """Share of the middle of a picture that is not its most common colour."""
    height, width = image.shape[:2]
    middle = image[height // 5 : -height // 5, width // 3 : -width // 3].reshape(-1, 3).astype(int)
    _, count = np.unique(middle @ [65536, 256, 1], return_counts=True)
    return 1.0 - float(count.max()) / len(middle)


def _fetched(browser: Any) -> list[str]:
    """What the browser asked the network for since the last call."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    return [address for address in asked if address.startswith(("http:", "https:", "ws:", "wss:"))]


def test_the_viewer_opens_moves_in_time_and_tells_the_angle(
    browser: Any, scene: Scene, limb: KnownLimb, tmp_path: Path
) -> None:
    viewer = Viewer(start_server(port=_PORT), scene, poses=tmp_path / "poses.json")
    try:
        browser.get(f"http://127.0.0.1:{viewer.server.get_port()}")
        angles = _wait(lambda: browser.find_elements(By.CSS_SELECTOR, "[data-coordinate=elbow_flexion]"), "the angle")
        i = limb.subject.anatomy.coordinate_index("elbow_flexion")
        assert angles[0].text.startswith(f"{np.rad2deg(limb.thetas[0, i]):.1f}° ± 1.5°")
        _wait(lambda: _drawn(_picture(browser)) > 0.05, "the limb")
        before = _picture(browser)
        boxes = browser.find_elements(By.CSS_SELECTOR, "input[type=text]")
        frame = next(box for box in boxes if box.is_displayed() and box.get_attribute("value") == "0")
        frame.send_keys(Keys.CONTROL + "a")
        frame.send_keys("6", Keys.ENTER)
        expected = f"{np.rad2deg(limb.thetas[6, i]):.1f}° ± 1.5°"

        def told() -> bool:
            return any(
                element.text.startswith(expected)
                for element in browser.find_elements(By.CSS_SELECTOR, "[data-coordinate=elbow_flexion]")
            )

        _wait(told, "the angle of frame 6")
        assert "(7 of 12)" in browser.find_element(By.TAG_NAME, "body").text
        _wait(lambda: np.abs(_picture(browser).astype(int) - before).mean() > 0.5, "another picture")
    finally:
        viewer.stop()


def test_the_scene_file_plays_without_a_network(browser: Any, scene: Scene, tmp_path: Path) -> None:
    write_embedded(scene, tmp_path / "scene.html", most_frames=4)
    _fetched(browser)
    browser.get((tmp_path / "scene.html").as_uri())
    _wait(lambda: _drawn(_picture(browser)) > 0.05, "the limb")
    assert "Translucent skin" in browser.find_element(By.TAG_NAME, "body").text
    assert _fetched(browser) == []


def test_the_report_draws_its_charts_without_a_network(browser: Any, limb: KnownLimb, tmp_path: Path) -> None:
    write_report(known_motion(limb), reported_subject(limb), None, tmp_path / "report.html", title="motion")
    _fetched(browser)
    browser.get((tmp_path / "report.html").as_uri())
    _wait(lambda: len(browser.find_elements(By.CSS_SELECTOR, ".plotly-graph-div svg.main-svg")) >= 2, "the charts")
    lines = browser.find_elements(By.CSS_SELECTOR, ".plotly-graph-div path.js-line")
    assert len(lines) >= 6
    assert _drawn(_picture(browser)) > 0.05
    assert _fetched(browser) == []
