"""Real recordings through the command line: how well the arm is found, frame by frame, and a picture of each frame.

    python docs/figures/real_data.py RECORDINGS --work WORK --out docs/images

RECORDINGS holds the folders named in docs/real-data.md, which do not ship. Runs that page's commands (those whose
output stands in WORK already are left out), prints its tables and writes its contact sheets. Takes minutes.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from adapt.anatomy import Floats
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.match.visibility import visible_vertices
from adapt.model.body import Body, pose_skin, posed_bones
from adapt.subject import load_subject
from capture._open3d import open3d
from capture.cloud.fuse import Cloud, View, fuse
from capture.commands.region_options import as_region
from capture.console import stdout
from capture.projection import project
from capture.recording import instants, open_recording
from capture.rigid import apply, inverse
from track.cli import bonetrack
from track.motion import load_motion
from track.observed_bones import Bools, skin_shown
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render, save_png

_LIMB_M = 0.05  # points farther from the skin belong to something else
_COUNTS = 0.5  # skin with at least this fit weight: not the fingers, not the shoulder's cut
_FINE_M = 0.003
_PANEL = (216, 171)
_TILE = (300, 300)
_SHOWN_POINTS = 5  # one of so many, lest they hide the limb


@dataclass(frozen=True)
class Case:
    """One recording: where it comes from, how it is imported, and what the other commands are told."""

    name: str
    source: str
    importing: str
    region: tuple[float, ...]
    adapting: str


KINECT = Case(
    "kinect",
    "upperbody_arms_kinect1_skeltrack",
    "--format raw --pattern 'depth-data-*' --fx 585 --fps 1",
    (-0.75, -0.6, 0.5, 0.02, 0.7, 1.7),
    "--poses 4 --frames 5,7,9,10",
)
SR305 = Case(
    "sr305",
    "forearm_sr305/20210326-231615",
    "--fx 476.007 --cx 313.683 --cy 242.755 --unit-mm 0.125 --fps 1",
    (-0.3, -0.4, 0.3, 0.35, 0.4, 0.9),
    "--poses 4 --frames 4,6,8,9",
)


def commands(case: Case, recordings: Path, work: Path) -> list[tuple[Path, str]]:
    """What each command writes, and the command."""
    recording, subject, motion = work / case.name, work / f"{case.name}.npz", work / f"{case.name}.motion"
    region = "--region " + " ".join(f"{x:g}" for x in case.region)
    adapting = f"--anatomy upper-limb-right {case.adapting} {region}"
    return [
        (recording, f"import '{recordings / case.source}' {case.importing} --out '{recording}'"),
        (subject, f"adapt '{recording}' {adapting} --out '{subject}'"),
        (motion / "motion.npz", f"track '{recording}' --subject '{subject}' {region} --out '{motion}'"),
    ]


def skin_to_cloud(body: Body, theta: Floats, shown: Bools, cloud: Cloud) -> float:
    """Median distance (m) from the skin that the sensors should see, of bones that show, to the nearest point."""
    sample = sample_skin(body.anatomy)
    skin, chosen = pose_skin(body, theta), np.flatnonzero(_counts(body, shown))
    points, normals = skin[chosen], sample.normals(skin)[chosen]
    target = Target(cloud)
    seen = np.any([visible_vertices(view, points, normals) for view, _, _ in target.parts], axis=0)
    nearest = np.min([tree.query(points[seen])[0] for _, _, tree in target.parts], axis=0)
    return float(np.median(nearest))


def _counts(body: Body, shown: Bools) -> Bools:
    return np.asarray((body.anatomy.fit_weight >= _COUNTS) & skin_shown(body, shown))


def cloud_to_skin(body: Body, theta: Floats, shown: Bools, cloud: Cloud) -> float:
    """Median distance (m) from the points nearest to the skin of bones that show to its surface."""
    core, skin, faces = open3d().core, pose_skin(body, theta), body.anatomy.skin_faces
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(
        core.Tensor.from_numpy(skin.astype(np.float32)), core.Tensor.from_numpy(faces.astype(np.uint32))
    )
    closest = scene.compute_closest_points(core.Tensor.from_numpy(cloud.points.astype(np.float32)))
    distance = np.linalg.norm(closest["points"].numpy() - cloud.points, axis=1)
    counts = _counts(body, shown)[faces[closest["primitive_ids"].numpy().astype(np.int64), 0]]
    return float(np.median(distance[counts & (distance < _LIMB_M)]))


def panel(body: Body, theta: Floats | None, shown: Bools, cloud: Cloud, label: str) -> NDArray[np.uint8]:
    """The fit over the cloud from the sensor and from the side, only bones that show; the cloud alone without a fit."""
    sensor = cloud.views[0].world_from_sensor
    up, framed = -sensor[:3, 1], cloud.points if theta is None else pose_skin(body, theta)[skin_shown(body, shown)]
    front = sensor[:3, 3] - framed.mean(axis=0)
    images = []
    for direction in (front, np.cross(up, front)):
        eye = look_at(framed, direction, up)
        layers = [] if theta is None else body_layers(body, theta, shown=shown)
        camera = framing_camera(eye, framed, width=_PANEL[0], height=_PANEL[1])
        images.append(render(layers, eye, camera, points=cloud.points[::_SHOWN_POINTS]))
    image = np.ascontiguousarray(np.concatenate(images, axis=1))
    cv2.putText(image, label, (4, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (200, 0, 0), 1, cv2.LINE_AA)
    return np.asarray(image, dtype=np.uint8)


def report(case: Case, work: Path, picture: Path) -> None:
    """Print a table of the case's frames and write its contact sheet."""
    recording, motion = open_recording(work / case.name), load_motion(work / f"{case.name}.motion")
    body, region = load_subject(work / f"{case.name}.npz").body, as_region(case.region)
    table = Table(
        "frame", "skin to cloud (mm)", "cloud to skin (mm)", "coverage", "do not show", "lost because", title=case.name
    )
    panels = []
    for k, moment in enumerate(instants(recording)):
        cloud = fuse(recording, moment, region=region, spacing_m=_FINE_M)
        if motion.lost[k]:
            table.add_row(str(k), "-", "-", f"{100 * motion.coverage[k]:.0f} %", "-", motion.lost[k])
            panels.append(panel(body, None, motion.shown[k], fuse(recording, moment, region=region), f"{k} lost"))
            continue
        theta, shown, hidden = motion.thetas[k], motion.shown[k], ", ".join(motion.hidden(k))
        there, back = (1e3 * measure(body, theta, shown, cloud) for measure in (skin_to_cloud, cloud_to_skin))
        table.add_row(str(k), f"{there:.1f}", f"{back:.1f}", f"{100 * motion.coverage[k]:.0f} %", hidden, "")
        label = f"{k} without {hidden}" if hidden else str(k)
        panels.append(panel(body, theta, shown, fuse(recording, moment, region=region), label))
    stdout.print(table)
    save_png(_sheet(panels), picture)


def outlines(case: Case, work: Path, picture: Path) -> None:
    """The example poses as the sensor saw them: outline of the fitted skin (red) and bones (yellow) on the depth."""
    recording, subject = open_recording(work / case.name), load_subject(work / f"{case.name}.npz")
    moments, region, tiles = instants(recording), as_region(case.region), []
    for theta, time in zip(subject.thetas, subject.times, strict=True):
        moment = min(moments, key=lambda m: abs(m.time_s - time))
        view = fuse(recording, moment, region=region).views[0]
        skin = _pixels(view, pose_skin(subject.body, theta))
        outline = np.zeros(view.depth.shape, np.uint8)
        for triangle in skin[subject.anatomy.skin_faces]:
            cv2.fillConvexPoly(outline, triangle, 255)
        image = cv2.cvtColor(_grey(view.depth), cv2.COLOR_GRAY2RGB)
        contours, _ = cv2.findContours(outline, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(image, contours, -1, (255, 0, 0), 1)
        for bone in posed_bones(subject.body, theta).values():
            for x, y in _pixels(view, bone[::6]):
                cv2.circle(image, (int(x), int(y)), 0, (255, 255, 0))
        (left, top), (right, bottom) = np.maximum(skin.min(axis=0) - 15, 0), skin.max(axis=0) + 15
        tiles.append(np.asarray(cv2.resize(image[top:bottom, left:right], _TILE), dtype=np.uint8))
    save_png(_sheet(tiles, columns=4), picture)


def _pixels(view: View, points: Floats) -> NDArray[np.int32]:
    uv, _ = project(view.camera, apply(inverse(view.world_from_sensor), points))
    return np.rint(uv).astype(np.int32)


def _grey(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Near is bright, nothing is black."""
    seen = depth[depth > 0.0]
    shade = 255.0 - 200.0 * (depth - seen.min()) / max(float(np.ptp(seen)), 1e-6)
    return np.where(depth > 0.0, np.clip(shade, 30.0, 255.0), 0.0).astype(np.uint8)


def _sheet(panels: list[NDArray[np.uint8]], *, columns: int = 3) -> NDArray[np.uint8]:
    rows = -(-len(panels) // columns)
    filled = [*panels, *[np.full_like(panels[0], 255)] * (rows * columns - len(panels))]
    lines = [np.concatenate(filled[columns * r : columns * (r + 1)], axis=1) for r in range(rows)]
    few_colours = np.rint(np.concatenate(lines, axis=0) / 17.0) * 17.0  # a smaller file; 255 stays
    return np.asarray(few_colours, dtype=np.uint8)


@click.command()
@click.argument("recordings", type=click.Path(path_type=Path, exists=True))
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Where recordings and results go.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Where pictures go.")
@click.option("--only", type=click.Choice([KINECT.name, SR305.name]), default=None, help="One recording.")
def main(recordings: Path, work: Path, out: Path, only: str | None) -> None:
    """Run the commands, print the tables, write the pictures."""
    work.mkdir(parents=True, exist_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    for case in (KINECT, SR305):
        if only not in (None, case.name):
            continue
        for result, command in commands(case, recordings, work):
            stdout.print(f"bonetrack {command}", highlight=False, soft_wrap=True)
            if not result.exists():
                bonetrack.main(shlex.split(command), standalone_mode=False)
        outlines(case, work, out / f"real-{case.name}-poses.png")
        report(case, work, out / f"real-{case.name}.png")


if __name__ == "__main__":
    main()
