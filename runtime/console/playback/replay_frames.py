"""The program of the worker process: frames of replayed cycles, made by the same encoder as those of a live run."""

from __future__ import annotations

import sys

from config.settings import Settings
from runtime.console.frames.frame_encoder import FrameContext, FrameEncoder
from runtime.console.frames.grid_message import grid_message
from runtime.console.frames.session_info import session_info
from runtime.console.frames.state_message import PlaybackRow
from runtime.console.playback.replay_cursor import ReplayedCycle
from runtime.console.playback.replay_worker import FrameParts, PlaybackPosition, run_worker
from runtime.console.sent_messages import GridMessage, SessionInfo
from runtime.cycle.step import CycleRecord


class ReplayFrames:
    """Makes the frames of a recording's cycles."""

    def __init__(self, settings: Settings, *, emulated: bool) -> None:
        self._settings = settings
        self._emulated = emulated
        self._encoder = FrameEncoder(settings)

    def session(self) -> SessionInfo:
        """Return the session information of the recorded run; the page keeps its own choice of units."""
        settings = self._settings
        info = session_info(settings, name=settings.robot.name, emulated=self._emulated, units="m")
        del info["units"]
        return info

    def take(self, record: CycleRecord) -> None:
        """Take in a cycle, whether or not it is shown."""
        self._encoder.take(record)

    def frame(self, replayed: ReplayedCycle, position: PlaybackPosition) -> FrameParts:
        """Return the frame of a cycle."""
        playback: PlaybackRow = {"s": position.s, "is_playing": position.is_playing, "speed": position.speed}
        context = FrameContext(host_s=position.s, late_s=None, missed=None, late=None, link=None, playback=playback)
        frame = self._encoder.frame(replayed.state, replayed.record, context)
        return FrameParts(frame.head, frame.changes, frame.whole())

    def grid(self, replayed: ReplayedCycle) -> GridMessage:
        """Return the evidence grid after a cycle, as a message."""
        return grid_message(replayed.state)


if __name__ == "__main__":
    sys.exit(run_worker(sys.argv[1], ReplayFrames))
