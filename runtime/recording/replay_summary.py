"""The summary of a replay in the JSON forms of the public surface."""

from __future__ import annotations

from typing import NotRequired, TypedDict

from runtime.cycle.summary import ObjectRow
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
    damage: list[str]


class ReplaySummary(TypedDict):
    """Summary of ``echolocate replay``."""

    verify: NotRequired[VerifyRow]

    objects: list[ObjectRow]
    segments: int
    clusters: int
    cycles: int
    cycle_us: Quantiles
