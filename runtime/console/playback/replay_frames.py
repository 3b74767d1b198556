"""The program that plays a recording for one page: frames as of a live run, of cycles that are run again.

Of time a recording's frames tell only where in it they are: whether the live run is paused is not theirs to say.
"""

from __future__ import annotations

import sys
from typing import Any

from config.settings import Settings
from runtime.console.frames.frame_encoder import FrameContext, FrameEncoder
from runtime.console.frames.session_info import session_info
from runtime.console.playback.replay_cursor import Shown
from runtime.console.playback.replay_worker import At, Picture, play
from runtime.cycle.step import CycleRecord


class ReplayFrames:
    """Makes frames of a recording's cycles.

    Parameters
    ----------
    settings : Settings
        In force in the recording.
    emulated : bool
        Whether their world is what stood there.
    """

    def __init__(self, settings: Settings, *, emulated: bool) -> None:
        self._settings = settings
        self._emulated = emulated
        self._encoder = FrameEncoder(settings)

    def about(self) -> dict[str, Any]:
        """Return what a page is told first; in which units it shows things is its own affair."""
        told = session_info(self._settings, name=None, emulated=self._emulated, units="m") | {"recording": True}
        del told["units"]
        return told

    def take(self, record: CycleRecord) -> None:
        """Take note of a cycle, whether or not it is shown."""
        self._encoder.take(record)

    def frame(self, shown: Shown, at: At) -> Picture:
        """Return the frame of a cycle."""
        frame = self._encoder.frame(shown.state, shown.record, FrameContext(host_s=at.s, playback=at._asdict()))
        return Picture(frame.head, frame.changes, frame.whole())


def make(settings: Settings, *, emulated: bool) -> ReplayFrames:
    """Return what makes frames for these settings."""
    return ReplayFrames(settings, emulated=emulated)


if __name__ == "__main__":
    sys.exit(play(sys.argv[1], make))
