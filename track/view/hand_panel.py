"""Set the pose of a frame by hand: a slider for each coordinate, a handle for the whole limb, a file to keep it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Coordinate, Floats
from adapt.model.pose_space import root_coordinates, root_joint
from capture.errors import BonetrackError
from capture.rigid import exp_so3, log_so3
from track.poses_by_hand import UNITS, HandPose, as_shown, from_shown, read_poses, write_poses
from track.tracked_frame import TrackedFrame

if TYPE_CHECKING:
    import viser

_REACH_M = 0.5  # how far a translation's slider goes to either side of where it was set


class HandPanel:
    """Sliders in the GUI's current place. ``changed`` is called when there is another pose to show.

    ``frame`` tells the frame that is shown, ``start`` the pose (n,) that setting begins from, ``fit`` what becomes of a
    frame's pose (n,) when it is fitted to that frame's points. A pose set by hand belongs to the frame it was set for:
    on another one it is neither shown nor saved, but it is there again when its frame is, until the viewer ends.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        anatomy: Anatomy,
        path: Path,
        *,
        frame: Callable[[], int],
        start: Callable[[], Floats],
        fit: Callable[[int, Floats], TrackedFrame],
        changed: Callable[[], None],
    ) -> None:
        self._server, self._anatomy, self._path = server, anatomy, path
        self._frame, self._start, self._fitted, self._changed = frame, start, fit, changed
        self._poses = self._read()
        self._theta = np.array([coordinate.rest for coordinate in anatomy.coordinates])  # what the sliders show
        self._drafts: dict[int, Floats] = {}  # poses set by hand, by the frame they were set for
        self._upon: dict[int, HandPose | None] = {}  # what was saved for a frame when setting its pose began
        self._unsaved: set[int] = set()
        self._followed: int | None = None  # the frame whose pose the sliders show
        self._before_fit: tuple[int, Floats] | None = None
        self._setting = False
        self._on = server.gui.add_checkbox(
            "Show the pose set by hand", False, hint="Instead of the tracked pose of this frame"
        )
        self._take = server.gui.add_button("Begin from the pose of this frame")
        self._root = root_coordinates(anatomy)
        where = set(root_joint(anatomy).coordinates)
        sliders = {c.name: self._slider(c) for c in anatomy.coordinates if c.name not in where}
        with server.gui.add_folder("Where the limb is (or drag the handle)", expand_by_default=False):
            sliders |= {c.name: self._slider(c) for c in anatomy.coordinates if c.name in where}
        self._sliders = [sliders[coordinate.name] for coordinate in anatomy.coordinates]
        self._gizmo = server.scene.add_transform_controls("/hand", scale=0.15, visible=False, line_width=3.0)
        self._fit = server.gui.add_button(
            "Fit to the points from here", hint="What tracking makes of this frame when it starts from this pose"
        )
        self._undo = server.gui.add_button("Undo the fit", disabled=True)
        self._said = server.gui.add_markdown("")
        self._name = server.gui.add_text("Name", "")
        self._save = server.gui.add_button(f"Save into {path.name}")
        self._told = server.gui.add_markdown(self._list())
        self._on.on_update(lambda _: self._switched())
        self._take.on_click(lambda _: self._begin_anew())
        self._fit.on_click(lambda _: self._fit_from_here())
        self._undo.on_click(lambda _: self._undo_fit())
        self._save.on_click(lambda _: self._keep())
        self._gizmo.on_update(lambda _: self._dragged())

    @property
    def theta(self) -> Floats | None:
        """The pose (n,) set by hand for the frame that is shown, if it is to be shown."""
        draft = self._drafts.get(self._frame()) if self._on.value else None
        return None if draft is None else draft.copy()

    @property
    def _is_of_this_frame(self) -> bool:
        frame = self._frame()
        return frame in self._drafts and frame == self._followed

    def follow(self) -> None:
        """Let the sliders show the pose that belongs to the frame shown; of a frame they show already, do nothing."""
        frame = self._frame()
        if not self._on.value or frame == self._followed:
            return
        self._put(self._pose_of(frame))
        self._name_of(frame)

    def _pose_of(self, frame: int) -> Floats:
        """What was set for a frame, else what is saved for it, else what setting begins from."""
        if frame in self._drafts:
            return self._drafts[frame]
        return self._poses[frame].theta if frame in self._poses else self._start()

    def _name_of(self, frame: int) -> None:
        self._name.value = self._poses[frame].name if frame in self._poses else f"frame {frame}"

    def _slider(self, coordinate: Coordinate) -> Any:
        low, high = as_shown(coordinate, coordinate.low), as_shown(coordinate, coordinate.high)
        step = 0.1 if UNITS[coordinate.unit] == "deg" else 0.001
        slider = self._server.gui.add_slider(
            f"{coordinate.name} ({UNITS[coordinate.unit]})", low, high, step, as_shown(coordinate, coordinate.rest)
        )
        slider.on_update(lambda _: self._slid())
        return slider

    def _switched(self) -> None:
        self._gizmo.visible = bool(self._on.value)
        if self._on.value:
            self._begin()
        else:
            self._changed()

    def _begin(self) -> None:
        frame = self._frame()
        if frame not in self._drafts:
            self._upon[frame] = self._poses.get(frame)
        self._set(self._pose_of(frame))
        self._name_of(frame)
        self._forget_fit()
        self._changed()

    def _begin_anew(self) -> None:
        """Give up what was set for this frame and not saved, as the button says."""
        self._drafts.pop(self._frame(), None)
        self._unsaved.discard(self._frame())
        self._told.content = self._list()
        self._begin()

    def _fit_from_here(self) -> None:
        """Replace the pose by the one that is reached from it, if that fits; it can be undone."""
        if not self._on.value or not self._is_of_this_frame:
            self._on.value = True
            self._begin()
        frame = self._frame()
        set_by_hand = self._drafts[frame].copy()
        self._fit.disabled, self._said.content = True, "Fitting ..."
        try:
            found = self._fitted(frame, set_by_hand)
        except BonetrackError as error:
            self._said.content = f"**Not fitted**: {error}"
            return
        finally:
            self._fit.disabled = False
        if found.lost:
            self._said.content = f"**Not fitted**: {found.lost}. Set the pose nearer to the points, and fit again."
            return
        self._drafts[frame] = self._inside(found.theta)  # whichever frame is shown by now
        if frame == self._frame():
            self._put(found.theta)
        self._note(frame)
        self._before_fit, self._undo.disabled = (frame, set_by_hand), False
        self._said.content = _fit_in_words(found, self._anatomy)
        self._changed()

    def _undo_fit(self) -> None:
        if self._before_fit is not None and self._before_fit[0] == self._frame():
            self._set(self._before_fit[1])
            self._note(self._frame())
            self._forget_fit()
            self._changed()

    def _forget_fit(self) -> None:
        self._before_fit, self._undo.disabled, self._said.content = None, True, ""

    def _set(self, theta: Floats) -> None:
        """Make a pose that of the frame shown."""
        self._put(theta)
        self._drafts[self._frame()] = self._theta.copy()

    def _note(self, frame: int) -> None:
        """Say that a frame's pose was changed and is not saved yet."""
        if frame not in self._unsaved:
            self._unsaved.add(frame)
            self._told.content = self._list()

    def _put(self, theta: Floats) -> None:
        """Put a pose into the sliders and the handle."""
        self._followed = self._frame()
        self._setting = True
        try:
            self._theta = self._inside(theta)
            for slider, coordinate, value in zip(self._sliders, self._anatomy.coordinates, self._theta, strict=True):
                shown = as_shown(coordinate, float(value))
                if coordinate.unit == "m":  # a range of 20 m would make every step a jump
                    slider.min, slider.max = round(shown - _REACH_M, 3), round(shown + _REACH_M, 3)
                slider.value = round(shown, 3 if coordinate.unit == "m" else 1)
            self._place_gizmo()
        finally:
            self._setting = False

    def _inside(self, theta: Floats) -> Floats:
        low = np.array([coordinate.low for coordinate in self._anatomy.coordinates])
        high = np.array([coordinate.high for coordinate in self._anatomy.coordinates])
        return np.asarray(np.clip(theta, low, high))

    def _slid(self) -> None:
        if self._setting:
            return
        if not self._is_of_this_frame:
            self._begin()
            return
        pairs = zip(self._sliders, self._anatomy.coordinates, strict=True)
        values = np.array([from_shown(coordinate, float(slider.value)) for slider, coordinate in pairs])
        # A slider holds a rounded value: only those that a person moved count.
        moved = np.abs(values - self._theta) > np.array([_step(c) for c in self._anatomy.coordinates])
        self._theta = self._inside(np.where(moved, values, self._theta))
        self._drafts[self._frame()] = self._theta.copy()
        self._place_gizmo()
        self._note(self._frame())
        self._changed()

    def _dragged(self) -> None:
        if self._setting:
            return
        if not self._is_of_this_frame:
            self._begin()
            return
        turn, shift = self._root[:3], self._root[3:]
        theta = self._theta.copy()
        theta[turn] = log_so3(Rotation.from_quat(np.asarray(self._gizmo.wxyz), scalar_first=True).as_matrix())
        theta[shift] = np.asarray(self._gizmo.position)
        self._set(theta)
        self._note(self._frame())
        self._changed()

    def _place_gizmo(self) -> None:
        turn, shift = self._root[:3], self._root[3:]
        self._gizmo.wxyz = Rotation.from_matrix(exp_so3(self._theta[turn])).as_quat(scalar_first=True)
        self._gizmo.position = self._theta[shift]

    def _keep(self) -> None:
        frame = self._frame()
        if frame not in self._drafts:
            others = ", ".join(map(str, sorted(self._drafts)))
            told = f"the pose was set for frame {others}" if others else "no pose was set yet"
            self._told.content = f"**Not saved**: {told}, and this is frame {frame}. Begin from the pose of this frame."
            return
        pose = HandPose(self._name.value.strip() or f"frame {frame}", frame, self._drafts[frame])
        known = self._upon.get(frame)
        try:
            self._poses = self._read()  # another viewer may have saved there meanwhile
            self._upon[frame] = self._poses.get(frame)
            if _differ(known, self._upon[frame]):
                words = f"another viewer saved or changed a pose of frame {frame} meanwhile; save again to replace it."
                self._told.content = f"**Not saved**: {words}\n\n{self._list()}"
                return
            write_poses(self._path, self._anatomy, (self._poses | {frame: pose}).values())
            self._poses = self._read()
            self._upon[frame] = self._poses.get(frame)
        except (BonetrackError, OSError) as error:
            self._told.content = f"**Not saved**: {error}"
            return
        self._unsaved.discard(frame)
        self._told.content = self._list()

    def _read(self) -> dict[int, HandPose]:
        """What stands in the file now, by frame."""
        return {pose.frame: pose for pose in read_poses(self._path, self._anatomy)} if self._path.exists() else {}

    def _list(self) -> str:
        lines = [f"No pose saved yet in `{self._path}`."]
        if self._poses:
            rows = [f"- frame {frame}: {pose.name}" for frame, pose in sorted(self._poses.items())]
            lines = [f"Saved in `{self._path}`:", "", *rows]
        if self._unsaved:
            frames = ", ".join(map(str, sorted(self._unsaved)))
            lines += ["", f"**Not saved yet**: frame {frames}. Go there and save, or it ends with the viewer."]
        return "\n".join(lines)


def _differ(one: HandPose | None, other: HandPose | None) -> bool:
    if one is None or other is None:
        return one is not other
    return one.name != other.name or not np.array_equal(one.theta, other.theta)


def _fit_in_words(found: TrackedFrame, anatomy: Anatomy) -> str:
    hidden = [bone.name for bone, shows in zip(anatomy.bones, found.shown, strict=True) if not shows]
    words = f"Fitted: skin and points are {1e3 * found.residual_m:.1f} mm apart (median), "
    words += f"{100.0 * found.coverage:.0f} % of the visible skin found."
    return f"{words} **Not in sight**, so guessed: {', '.join(hidden)}." if hidden else words


def _step(coordinate: Coordinate) -> float:
    """Half of a slider's step, in rad or m."""
    return from_shown(coordinate, 0.051 if UNITS[coordinate.unit] == "deg" else 0.00051)
