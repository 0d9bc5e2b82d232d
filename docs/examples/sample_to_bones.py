"""From a recording to bones, in Python.

    python docs/examples/sample_to_bones.py recordings/upper-limb-right-sample OUT

The recording itself is left as it is: a copy of it is calibrated.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy_file import load_anatomy
from adapt.model.body import posed_bones
from adapt.model.pose_space import reported_coordinates
from adapt.subject import load_subject, save_subject
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.recording import open_recording
from track.export.gltf import write_gltf
from track.observed_bones import known_thetas
from track.track_recording import track_recording


def main(source: Path, out: Path) -> None:
    """Calibrate, adapt, track; then look at what came out."""
    # 1. Where do the sensors stand? The box tells.
    shutil.copytree(source, out / "recording")
    recording = open_recording(out / "recording")
    write_calibration(recording, calibrate_recording(recording))
    recording = open_recording(recording.path)

    # 2. Who is it? The template, reshaped until its skin explains some poses. Who was adapted before stays the same.
    if not (out / "subject.npz").exists():
        save_subject(adapt_recording(recording, load_anatomy("upper-limb-right")), out / "subject.npz")
    subject = load_subject(out / "subject.npz")

    # 3. How do they move?
    motion = track_recording(recording, subject, out / "motion")

    # Joint angles in degrees (T,), NaN where they are not known.
    known = known_thetas(subject.anatomy, motion.thetas, motion.shown)
    elbow = reported_coordinates(subject.anatomy, known)["elbow_flexion"]
    # One standard deviation of the same, in degrees.
    column = motion.coordinates.index("elbow_flexion")
    deviation = np.rad2deg(motion.deviations[:, column])
    # Joint centres (T, 3) and bone transforms (T, 4, 4) from rest to pose, in metres and in the recording's frame.
    wrist = motion.centres["wrist"]
    ulna = motion.transforms["ulna"]

    for frame in np.flatnonzero(motion.tracked)[:3]:
        sys.stdout.write(
            f"{motion.times[frame]:.2f} s: elbow {elbow[frame]:.1f} ± {deviation[frame]:.1f} degrees, "
            f"wrist at {np.round(wrist[frame], 3)} m, ulna shifted by {np.round(ulna[frame, :3, 3], 3)} m\n"
        )
        surface = posed_bones(subject.body, motion.thetas[frame])["ulna"]  # (N, 3) m
        np.save(out / f"ulna_{frame:05d}.npy", surface)

    # An animated skeleton for Blender and the like.
    report = write_gltf(motion, subject, out / "motion.glb")
    sys.stdout.write(f"skin of motion.glb: off by at most {1e3 * report.skin.largest_m:.1f} mm\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
