"""The viewer: a scene in the browser, with timeline, layers, joint angles, and poses set by hand."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from adapt.anatomy import Floats
from capture.cloud.fuse import Region
from capture.errors import BonetrackError
from track.fit_from_hand import fit_from_hand
from track.tracked_frame import TrackedFrame
from track.tracker import Tracker, make_tracker
from track.view.angle_charts import LEGEND, AngleCharts
from track.view.frames import FrameContent, FrameStore, SeenPoints, Single, distances, pose_body, truth_of
from track.view.guard import guarded
from track.view.hand_panel import HandPanel
from track.view.layers import FAR_M, LARGEST_ERROR_M, LAYERS, Layers, first_eye, set_eye
from track.view.scene import Scene
from track.view.timeline import Timeline

if TYPE_CHECKING:
    import viser

LOOPBACK, PORT = "127.0.0.1", 8080
_OFF = ("truth", "labels")  # layers that are switched on by hand: they lie on the bones
_CHARTS_EVERY_S = 0.15  # while playing; the scene itself is shown frame by frame


class ViewError(BonetrackError):
    """The viewer cannot be shown."""


def start_server(*, host: str = LOOPBACK, port: int = PORT) -> viser.ViserServer:
    """A viser server: on this machine only, unless another host is given.

    Raises:
        ViewError: viser is not installed, or the host is not this machine.
    """
    _refuse_strange_host(host)
    try:
        import viser
    except ImportError as error:
        raise ViewError("the viewer needs viser", remedy="pip install 'bonetrack[view]'") from error
    with redirect_stdout(StringIO()), guarded(host):  # it would greet with a box of its own
        return viser.ViserServer(host=host, port=port, verbose=False)


def _refuse_strange_host(host: str) -> None:
    """Told at once: the server would try one port after the other, and say nothing."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as tried:
            tried.bind(address)
    except OSError as error:
        remedy = "give an address of this machine, or 0.0.0.0 for all of its addresses"
        raise ViewError(f"nobody can connect to this machine as {host!r}", remedy=remedy) from error


def stop_server(server: viser.ViserServer) -> None:
    """End a server without a word."""
    with redirect_stdout(StringIO()):
        server.stop()


class Viewer:
    """A scene in a viser server. All that is shown goes through ``show``, one frame at a time."""

    def __init__(
        self, server: viser.ViserServer, scene: Scene, *, poses: Path = Path("poses.json"), region: Region | None = None
    ) -> None:
        self.scene, self.server = scene, server
        self._lock = threading.RLock()
        self._charts_shown = -np.inf
        self._hand: HandPanel | None = None
        self._region = region
        self._tracker: Tracker | None = None
        self._charts: AngleCharts | None = None
        self.frames = FrameStore(scene, region=region)
        self.layers = Layers(server, scene)
        set_eye(server, first_eye(scene, self.frames))
        self._dress()
        self._status = server.gui.add_markdown("")
        self.timeline = Timeline(server, scene.times, self.show)
        self._add_tabs(poses)
        self._add_angles()
        self.frames.make_ahead(self._made)
        self.show(0)

    def show(self, k: int) -> None:
        """Show frame k: at once what is quick to make, the cloud as soon as it is there."""
        with self._lock:
            if self._hand is not None and not self.timeline_plays:
                self._hand.follow()
            theta = self._theta(k)
            content = self.frames.ready(k) or self._quick(k)
            if self._hand is not None and self._hand.theta is not None:
                content = self._by_hand(content, self._hand.theta)
            self.layers.show(k, content, theta=theta)
            self._status.content = self._words(k, content)
            now = time.perf_counter()
            if self._charts is not None and not (self.timeline_plays and now - self._charts_shown < _CHARTS_EVERY_S):
                self._charts.show(k, theta, by_hand=self._by_hand_shown)
                self._charts_shown = now
        self.frames.look_at(k)

    @property
    def _by_hand_shown(self) -> bool:
        return self._hand is not None and self._hand.theta is not None

    @property
    def timeline_plays(self) -> bool:
        """Whether time goes on by itself."""
        return self.timeline.playing

    def stop(self) -> None:
        """End all threads and the server."""
        self.timeline.stop()
        self.frames.stop()
        stop_server(self.server)

    def _dress(self) -> None:
        gui = self.server.gui
        gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False, brand_color=(31, 95, 168))
        gui.set_panel_label(f"bonetrack: {self.scene.title}")
        gui.main_panel.dock_right()
        self.server.scene.configure_default_lights(cast_shadow=False)

    def _add_tabs(self, poses: Path) -> None:
        gui = self.server.gui
        tabs = gui.add_tab_group()
        with tabs.add_tab("Layers"):
            for name in self.layers.names():
                box = gui.add_checkbox(LAYERS[name], name not in _OFF)
                self.layers.switch(name, box.value)
                box.on_update(lambda event, name=name: self.layers.switch(name, event.target.value))
            if self.scene.recording is not None and self.scene.body is not None:
                gui.add_html(_ERROR_LEGEND)
            gui.add_button("Save this view as a picture").on_click(self._save_picture)
        if self.scene.anatomy is not None and self.scene.recording is not None:
            with tabs.add_tab("Pose by hand"):
                self._hand = HandPanel(
                    self.server,
                    self.scene.anatomy,
                    poses,
                    frame=lambda: self.scene.numbers[self.timeline.frame],
                    start=self._start,
                    fit=self._fit,
                    changed=lambda: self.show(self.timeline.frame),
                )

    def _add_angles(self) -> None:
        if self.scene.anatomy is None or (self.scene.recording is None and self.scene.motion is None):
            return
        panel = self.server.gui.add_panel()
        with panel.add_tab("Joint angles"):
            self.server.gui.add_html(LEGEND)
            self._charts = AngleCharts(self.server, self.scene)
        panel.dock_left()

    def _theta(self, k: int) -> Floats | None:
        if self._hand is not None and self._hand.theta is not None:
            return self._hand.theta
        return None if self.scene.body is None else self.scene.angles[k]

    def _start(self) -> Floats:
        """What setting by hand begins from: the frame's pose, else the nearest frame's, else the first example pose."""
        subject, thetas = self.scene.subject, self.scene.thetas
        if subject is None or thetas is None:
            raise ViewError("nobody to pose", remedy="give --subject")
        known = np.flatnonzero(np.isfinite(thetas).all(axis=1))
        start = thetas[known[np.abs(known - self.timeline.frame).argmin()]] if len(known) else subject.thetas[0]
        return np.asarray(start)

    def _fit(self, number: int, theta: Floats) -> TrackedFrame:
        """What tracking makes of the recording's frame of that number, from the pose theta (n,)."""
        scene = self.scene
        if scene.subject is None or scene.recording is None or scene.moments is None:
            raise ViewError("there is nothing to fit to", remedy="give --subject and --recording")
        if self._tracker is None:
            self._tracker = make_tracker(scene.subject)
        region, moment = self._region or scene.region, scene.moments[list(scene.numbers).index(number)]
        return fit_from_hand(self._tracker, scene.recording, moment, theta, region=region)

    def _quick(self, k: int) -> FrameContent:
        posed = None
        if self.scene.body is not None and self.scene.thetas is not None:
            posed = pose_body(self.scene.body, self.scene.thetas[k])
        return FrameContent(posed, truth_of(self.scene, k), None)

    def _by_hand(self, content: FrameContent, theta: Floats) -> FrameContent:
        posed = None if self.scene.body is None else pose_body(self.scene.body, theta)
        seen = content.seen
        if seen is not None and len(seen.points):
            seen = SeenPoints(seen.points, distances(self.scene, seen.points, posed))
        return FrameContent(posed, content.truth, seen)

    def _made(self, k: int) -> None:
        if k == self.timeline.frame:
            self.show(k)

    def _words(self, k: int, content: FrameContent) -> str:
        """What is said of frame k."""
        scene = self.scene
        if scene.recording is None and scene.motion is None:
            return "The subject in its rest pose."
        lines = [f"**Frame {scene.numbers[k]}** ({k + 1} of {len(scene.times)}), {scene.times[k]:.3f} s"]
        if self._by_hand_shown:
            lines.append("Pose set by hand.")
        elif scene.motion is not None and scene.motion.lost[k]:
            lines.append(f"**Lost**: {scene.motion.lost[k]}.")
        elif scene.motion is not None:
            coverage = 100.0 * scene.motion.coverage[k]
            lines.append(f"Tracked; {coverage:.0f} % of the visible skin found.")
            if hidden := scene.motion.hidden(k):
                lines.append(f"**Not in sight** (red, where it may be): {', '.join(hidden)}.")
        if content.seen is not None and content.seen.problem:
            lines.append(f"No points: {content.seen.problem}.")
        elif content.seen is not None and content.seen.distances is not None:
            lines.append(_points_in_words(content.seen.distances))
        return "  \n".join(lines)

    def _save_picture(self, event: Any) -> None:
        import cv2

        client = event.client
        if client is None:
            return
        height = 1080
        width = round(height * client.camera.aspect)
        image = client.get_render(height, width, transport_format="png", timeout=30.0)
        opaque = image[..., 3:] / 255.0
        flat = (image[..., :3] * opaque + 255.0 * (1.0 - opaque)).astype(np.uint8)
        _, encoded = cv2.imencode(".png", flat[:, :, ::-1])
        name = f"frame_{self.scene.numbers[self.timeline.frame]:05d}.png"
        client.send_file_download(name, encoded.tobytes(), save_immediately=True)


def _points_in_words(distances: Single) -> str:
    """How far points (N,) are from the skin (m), without those that count as something else, which are told apart.

    >>> _points_in_words(np.array([0.001, 0.002, 0.003, 0.15]))
    'Points to skin: 2.0 mm (median); 25 % are farther than 20 mm.'
    """
    near = distances[distances <= FAR_M]
    words = f"Points to skin: {1e3 * float(np.median(near)):.1f} mm (median)" if len(near) else "No point near the skin"
    far = 100.0 * (1.0 - len(near) / max(1, len(distances)))
    return f"{words}; {far:.0f} % are farther than {1e3 * FAR_M:.0f} mm." if far >= 0.5 else f"{words}."


_ERROR_LEGEND = (
    "<div style='font-size:0.75rem;padding:0.2rem 0.8rem'>Distance of points to the skin"
    "<div style='height:0.7rem;border-radius:3px;background:linear-gradient(to right,"
    "#0d0887,#5302a3,#8b0aa5,#b83289,#db5c68,#f48849)'></div>"
    f"<div style='display:flex;justify-content:space-between'><span>0 mm</span><span>{1e3 * LARGEST_ERROR_M:.0f} mm "
    f"and more</span></div>grey: over {1e3 * FAR_M:.0f} mm, taken for something else</div>"
)
