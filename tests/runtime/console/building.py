"""A builder of frames for tests, and a program that plays with it: a frame says what it was made of, no more."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import orjson

from config.settings import Settings
from runtime.console.playback.replay_cursor import Shown
from runtime.console.playback.replay_worker import At, Picture, play
from runtime.cycle.step import CycleRecord
from runtime.recording.channels import encode
from runtime.recording.schema import Cycle


def told(shown: Shown) -> dict[str, Any]:
    """Return what distinguishes one cycle, and the state it left, from any other, to the bit."""
    memory = shown.state.perception.snapshot()
    return {
        "cycle": shown.record.cycle,
        "record": hash(encode(Cycle.model_construct(record=shown.record))),
        "memory": hash(b"".join(name.encode() + array.tobytes() for name, array in sorted(memory.items()))),
        "left": repr((shown.state.mode, shown.state.leg, shown.state.odometry, shown.state.run_s)),
    }


class Telling:
    """Counts the cycles it took, and which sensors it has heard."""

    def __init__(self, settings: Settings, *, emulated: bool) -> None:
        self._settings = settings
        self._emulated = emulated
        self._heard = np.zeros(len(settings.ring.mounts), dtype=bool)

    def about(self) -> dict[str, Any]:
        """Return what a page is told first."""
        return {"sensors": len(self._settings.ring.mounts), "emulated": self._emulated}

    def take(self, record: CycleRecord) -> None:
        """Take note of a cycle."""
        for firing in record.inputs.received.firings:
            self._heard |= ~np.isnan(firing.ranges_m)

    def frame(self, shown: Shown, at: At) -> Picture:
        """Return the frame of a cycle."""
        odometry = shown.state.odometry
        what = {
            "type": "state", "cycle": shown.record.cycle, "s": at.s, "playing": at.is_playing, "speed": at.speed,
            "heard": int(self._heard.sum()), "x": math.nan if odometry is None else odometry.pose.x,
        }  # fmt: skip
        return Picture(orjson.dumps(what)[:-1], b'{"whole":false}', b'{"whole":true}')


def make(settings: Settings, *, emulated: bool) -> Telling:
    """Return a builder."""
    return Telling(settings, emulated=emulated)


if __name__ == "__main__":
    sys.exit(play(sys.argv[1], make))
