"""The first page of a report, for whoever treats the person: who, what, how good, how far, what was lost and why."""

from __future__ import annotations

from collections import Counter
from html import escape

import numpy as np

from adapt.plain_words import plain_words
from track.about import About
from track.curves.norms import norm_of
from track.motion import Motion
from track.poses_by_hand import UNITS, as_shown
from track.view.page import bullets, paragraph, table
from track.view.report_motion import motion_of, subject_of
from track.view.scene import Scene, joint_coordinates

_LIMBS = {"upper-limb": "arm", "lower-limb": "leg"}
_UNSURE_DEG = 5.0
_MOST_REASONS = 4


def summary_section(scene: Scene, about: About) -> str:
    """The page: what is noted of the person and the session, then the results in words and one table."""
    motion = motion_of(scene)
    parts = [bullets(_who(scene, about))]
    if about.note:
        parts.append(f"<blockquote>{escape(about.note)}</blockquote>")
    parts += [paragraph(" ".join(_how_good(scene, motion))), _movement(scene, motion), _sources(scene)]
    parts += ["<h3>What was lost, and why</h3>", bullets(_lost(motion))]
    return "\n".join(part for part in parts if part)


def _who(scene: Scene, about: About) -> list[str]:
    """Who was recorded and what of them, as far as it is known."""
    anatomy = subject_of(scene).anatomy
    kind = next((word for name, word in _LIMBS.items() if anatomy.name.startswith(name)), None)
    limb = anatomy.name if kind is None else f"{anatomy.side} {kind}"
    seconds = float(scene.times[-1] - scene.times[0])
    recorded = f"{seconds:.1f} s, {len(scene.times)} frames, by depth sensors, without markers"
    known = {"Person": about.person, "Session": about.session, "Limb": limb, "Recorded": recorded}
    return [f"{what}: {words}" for what, words in known.items() if words]


def _how_good(scene: Scene, motion: Motion) -> list[str]:
    """How much was tracked, how near the skin came, and how sure the angles are."""
    tracked = motion.tracked
    said = [f"{100.0 * tracked.mean():.0f} % of the recording could be followed."]
    if not tracked.any():
        return said
    said.append(f"Where it could, the modelled skin lies {1e3 * float(np.median(motion.residuals[tracked])):.1f} mm")
    said.append("from what the sensors saw (median).")
    spreads = {}
    for i, coordinate in joint_coordinates(subject_of(scene).anatomy):
        known = np.isfinite(scene.angles[:, i])
        if coordinate.unit == "rad" and known.any():
            spreads[plain_words(coordinate.name).name] = float(np.rad2deg(np.median(motion.deviations[known, i])))
    if spreads:
        least, most = min(spreads.values()), max(spreads.values())
        said.append(f"Angles are stated to be within {2.0 * least:.1f} to {2.0 * most:.1f} degrees, 19 times in 20.")
    if unsure := [name for name, spread in spreads.items() if spread > _UNSURE_DEG]:
        said.append(f"Not sure enough to build on: {', '.join(unsure)}.")
    return said


def _movement(scene: Scene, motion: Motion) -> str:
    """How far every angle moved, in words, beside what healthy people reach."""
    rows = []
    for i, coordinate in joint_coordinates(subject_of(scene).anatomy):
        words, norm = plain_words(coordinate.name), norm_of(coordinate.name)
        values, factor = scene.angles[:, i], as_shown(coordinate, 1.0)
        name = f"{words.label} ({UNITS[coordinate.unit]})"
        cells = ["not seen", "", ""]
        if np.isfinite(values).any():
            low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
            ends = [f"{factor * values[k]:z.0f} ± {2.0 * factor * motion.deviations[k, i]:.0f}" for k in (low, high)]
            cells = [*ends, f"{factor * (values[high] - values[low]):.0f}"]
        rows.append([name, *cells, "" if norm is None else norm.reach, words.zero])
    head = ["movement", "from (± 2 SD)", "to (± 2 SD)", "range", "healthy adults reach", "zero is"]
    return table("How far it moved in this recording", head, rows)


def _sources(scene: Scene) -> str:
    """Where the norms stand, and what they are not."""
    norms = [(c.name, norm_of(c.name)) for _, c in joint_coordinates(subject_of(scene).anatomy)]
    told = [f"{plain_words(name).name}: {norm.whose}; {norm.source}." for name, norm in norms if norm is not None]
    if not told:
        return paragraph("Of these movements no open source of what healthy people reach was found.")
    words = "What healthy adults can reach, not what this movement asks for. "
    return paragraph(
        f"{words}{' '.join(one[:1].upper() + one[1:] for one in told)} Of the others no open source was found."
    )


def _lost(motion: Motion) -> list[str]:
    """Why frames were not followed, most frequent first, and which bones were out of sight."""
    lost = ~motion.tracked
    if lost.any():
        reasons = Counter(_without_numbers(reason) for reason in motion.lost if reason)
        said = [f"{count} of {len(lost)} frames: {why}." for why, count in reasons.most_common(_MOST_REASONS)]
        if len(reasons) > _MOST_REASONS:
            said.append(f"And {len(reasons) - _MOST_REASONS} more reasons, listed below.")
    else:
        said = ["Nothing: every frame was followed."]
    for name, shown in zip(motion.transforms, motion.shown.T, strict=True):
        if hidden := int((motion.tracked & ~shown).sum()):
            said.append(f"The {name} was out of sight in {hidden} more frames; nothing is said of it there.")
    return said


def _without_numbers(reason: str) -> str:
    """A reason without its numbers, so that frames lost alike are counted together.

    >>> _without_numbers("only 31 % of the skin that should show was found")
    'only … % of the skin that should show was found'
    """
    words = reason.split()
    return " ".join("…" if word.strip("(),;").replace(".", "", 1).isdigit() else word for word in words)
