"""The timeline: a slider over the frames, and playing at the recording's speed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from adapt.anatomy import Floats

if TYPE_CHECKING:
    import viser

SPEEDS = {"1": 1.0, "1/2": 0.5, "1/4": 0.25, "1/10": 0.1}


class Timeline:
    """Slider, play button and speed in the GUI's current place; ``show`` is told each new frame.

    A frame is chosen by the clock: a machine too slow to show all of them leaves some out and keeps the speed.
    """

    def __init__(self, server: viser.ViserServer, times: Floats, show: Callable[[int], None]) -> None:
        self._times, self._show = times, show
        self._playing, self._stopped = threading.Event(), threading.Event()
        self._lock = threading.Lock()
        self._begun = (0.0, 0.0)  # clock and time of the recording when playing began (s)
        self.frame = 0
        one = len(times) < 2
        self._slider = server.gui.add_slider("Frame", 0, max(1, len(times) - 1), 1, 0, visible=not one)
        self._button = server.gui.add_button("Play", visible=not one)
        self._speed = server.gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1", visible=not one)
        self._slider.on_update(lambda _: self._slid())
        self._button.on_click(lambda _: self._pause() if self._playing.is_set() else self._play())
        self._speed.on_update(lambda _: self._begin())
        if not one:
            threading.Thread(target=self._run, daemon=True).start()

    @property
    def playing(self) -> bool:
        """Whether time goes on by itself."""
        return self._playing.is_set()

    def go(self, frame: int) -> None:
        """Show a frame, and move the slider there."""
        self._set(frame)
        self._slider.value = frame
        self._begin()

    def stop(self) -> None:
        """End the thread."""
        self._stopped.set()
        self._playing.set()

    def frame_at(self, seconds: float) -> int:
        """The frame that is shown at a time of the recording (s): the last that has begun."""
        return int(np.clip(np.searchsorted(self._times, seconds, side="right") - 1, 0, len(self._times) - 1))

    def _slid(self) -> None:
        if self._slider.value != self.frame:
            self._set(int(self._slider.value))
            self._begin()

    def _set(self, frame: int) -> None:
        with self._lock:
            self.frame = frame
            self._show(frame)

    def _play(self) -> None:
        self._button.label = "Pause"
        if self.frame == len(self._times) - 1:
            self.frame = 0
        self._begin()
        self._playing.set()

    def _pause(self) -> None:
        self._playing.clear()
        self._button.label = "Play"
        self._show(self.frame)

    def _begin(self) -> None:
        self._begun = (time.perf_counter(), float(self._times[self.frame]))

    def _run(self) -> None:
        period = float(np.median(np.diff(self._times)))
        while not self._stopped.is_set():
            self._playing.wait()
            clock, from_s = self._begun
            seconds = from_s + (time.perf_counter() - clock) * SPEEDS[self._speed.value]
            if seconds > self._times[-1] + period:
                self.frame = 0
                self._begin()
                seconds = float(self._times[0])
            frame = self.frame_at(seconds)
            if frame != self.frame and self._playing.is_set():
                self._set(frame)
                self._slider.value = frame
            self._stopped.wait(min(0.5 * period, 0.02))
