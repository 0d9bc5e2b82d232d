"""The viewer and a report as a browser shows them, and what they cost, for docs/view.md.

    bonetrack demo --out DEMO
    python docs/figures/view.py DEMO --out docs/images

Needs Chromium with its driver and the extras `view` and `test`. Takes about a minute.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import click
import numpy as np
from browser import close_notices, open_browser

from adapt.subject import load_subject
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.recording import open_recording
from track.motion import load_motion
from track.view.embedded import write_embedded
from track.view.frames import FrameStore
from track.view.layers import Layers
from track.view.report import write_report
from track.view.scene import open_scene
from track.view.viewer import Viewer, start_server, stop_server

_FRAME = 50  # the elbow bends, hand and forearm turn
_WIDTH, _HEIGHT = 1280, 800
_SETTLED_S = 12.0  # what a software renderer may need to draw all that it was sent
_COLOURS = 200


@click.command()
@click.argument("demo", type=click.Path(path_type=Path, exists=True))
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"))
def main(demo: Path, out: Path) -> None:
    """Draw both pictures and print what showing a frame costs, and how large the files are."""
    _costs(demo)
    with tempfile.TemporaryDirectory() as folder, open_browser(Path(folder), width=_WIDTH, height=_HEIGHT) as browser:
        _viewer(browser, demo, out / "view.png", Path(folder))
        _report(browser, demo, out / "report.png", Path(folder))


def _costs(demo: Path) -> None:
    scene = open_scene(demo / "motion", subject=demo / "subject.npz", recording=demo / "recording")
    with tempfile.TemporaryDirectory() as folder:
        write_report_of(demo, Path(folder) / "report.html")
        frames = write_embedded(scene, Path(folder) / "scene.html")
        for name in ("report.html", "scene.html"):
            stdout.print(f"{name}: {(Path(folder) / name).stat().st_size / 1e6:.1f} MB", highlight=False)
        stdout.print(f"{frames} frames in scene.html", highlight=False)
        server = start_server()
        store, layers = FrameStore(scene), Layers(server, scene)
        made = _milliseconds(store.get, len(scene.times))
        shown = _milliseconds(lambda k: layers.show(k, store.get(k), theta=scene.angles[k]), len(scene.times))
        stop_server(server)
    stdout.print(f"a frame is made in {made:.0f} ms and shown in {shown:.1f} ms of CPU (medians)", highlight=False)


def _milliseconds(work: Callable[[int], Any], count: int) -> float:
    """Median CPU time of one piece of work (ms)."""
    spent = []
    for k in range(count):
        start = time.thread_time()
        work(k)
        spent.append(time.thread_time() - start)
    return 1e3 * float(np.median(spent))


def _viewer(browser: Any, demo: Path, path: Path, folder: Path) -> None:
    scene = open_scene(demo / "motion", subject=demo / "subject.npz", recording=demo / "recording")
    viewer = Viewer(start_server(), scene, poses=folder / "poses.json")
    try:
        browser.get(f"http://{viewer.server.get_host()}:{viewer.server.get_port()}")
        time.sleep(_SETTLED_S)
        close_notices(browser)
        viewer.timeline.go(_FRAME)
        time.sleep(_SETTLED_S)
        _save(browser, path)
    finally:
        viewer.stop()


def _report(browser: Any, demo: Path, path: Path, folder: Path) -> None:
    page = folder / "report.html"
    write_report_of(demo, page)
    browser.get(page.as_uri())
    time.sleep(_SETTLED_S / 2.0)
    browser.execute_script("document.getElementById('joint-angles').scrollIntoView()")
    time.sleep(1.0)
    _save(browser, path)


def write_report_of(demo: Path, page: Path) -> None:
    """The report of a demo's motion."""
    subject, recording = load_subject(demo / "subject.npz"), open_recording(demo / "recording")
    write_report(load_motion(demo / "motion"), subject, recording, page, title="demo/motion")


def _save(browser: Any, path: Path) -> None:
    """A screenshot in few colours: half a megabyte less, and nobody sees it."""
    from PIL import Image

    few = Image.open(BytesIO(browser.get_screenshot_as_png())).convert("RGB").quantize(_COLOURS)
    with replaced_when_complete(path) as partial:
        few.save(partial, optimize=True)


if __name__ == "__main__":
    main()
