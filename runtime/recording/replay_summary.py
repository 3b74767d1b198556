"""The summary of a replay in the JSON forms of the public surface."""

from __future__ import annotations

from typing import Literal, NotRequired, TypedDict

from runtime.cycle.summary import PerceivedRows, PoseRow
from runtime.timing.cycle_stats import Quantiles


class VerifyRow(TypedDict):
    """What the replay of a recording found: see `runtime.recording.verification.ReplayResult`."""

    differences: int
    first: str | None
    first_cycle: int | None
    keyframes: int
    skipped: int
    missing: list[tuple[int, int]]
    refinement: dict[str, int]
    times_real_time: float
    refused_keyframes: list[str]
    damage: list[str]


class ReplaySummary(PerceivedRows):
    """Summary of ``echolocate replay``."""

    verify: NotRequired[VerifyRow]

    pose: NotRequired[PoseRow]
    """Of a replay that corrects drift or has a map: the robot at the end."""
    frame: NotRequired[Literal["map"]]
    """The frame of pose and objects, where it is not odometry's."""

    segments: int
    clusters: int
    cycles: int
    cycle_us: Quantiles
