"""A frame maker for tests of playback, and a worker program that uses it: a frame names the cycle it was made of."""

from __future__ import annotations

import math
import sys
from typing import Any, cast

import numpy as np
import orjson

from config.settings import Settings
from runtime.console.playback.replay_cursor import ReplayedCycle
from runtime.console.playback.replay_worker import FrameParts, PlaybackPosition, run_worker
from runtime.console.sent_messages import GridMessage, SessionInfo
from runtime.cycle.step import CycleRecord
from runtime.recording.channels import encode
from runtime.recording.schema import Cycle


def fingerprint(replayed: ReplayedCycle) -> dict[str, Any]:
    """Return what distinguishes a cycle and the state after it from any other, to the bit."""
    memory = replayed.state.perception.snapshot()
    return {
        "cycle": replayed.record.cycle,
        "record": hash(encode(Cycle.model_construct(record=replayed.record))),
        "memory": hash(b"".join(name.encode() + array.tobytes() for name, array in sorted(memory.items()))),
        "left": repr((replayed.state.mode, replayed.state.leg, replayed.state.odometry, replayed.state.run_s)),
    }


class StubFrames:
    """Counts the cycles it took in and the sensors that have fired."""

    def __init__(self, settings: Settings, *, emulated: bool) -> None:
        self._settings = settings
        self._emulated = emulated
        self._fired = np.zeros(len(settings.ring.mounts), dtype=bool)

    def session(self) -> SessionInfo:
        """Return the session information of the recorded run."""
        return cast("SessionInfo", {"sensors": len(self._settings.ring.mounts), "emulated": self._emulated})

    def take(self, record: CycleRecord) -> None:
        """Take in a cycle."""
        for firing in record.inputs.received.firings:
            self._fired |= ~np.isnan(firing.ranges_m)

    def frame(self, replayed: ReplayedCycle, position: PlaybackPosition) -> FrameParts:
        """Return the frame of a cycle."""
        odometry = replayed.state.odometry
        head = {
            "type": "state", "cycle": replayed.record.cycle, "s": position.s, "playing": position.is_playing,
            "speed": position.speed, "fired": int(self._fired.sum()),
            "x": math.nan if odometry is None else odometry.pose.x,
        }  # fmt: skip
        return FrameParts(orjson.dumps(head)[:-1], b'"segments":{"whole":false}', b'"segments":{"whole":true}')

    def grid(self, replayed: ReplayedCycle) -> GridMessage:
        """Return the grid after a cycle: here only which cycle that is."""
        return cast("GridMessage", {"type": "grid", "cycle": replayed.record.cycle})


def make_stub_frames(settings: Settings, *, emulated: bool) -> StubFrames:
    """Return a frame maker."""
    return StubFrames(settings, emulated=emulated)


if __name__ == "__main__":
    sys.exit(run_worker(sys.argv[1], make_stub_frames))
