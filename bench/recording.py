"""Cost of recording: loop time per cycle and disk space, in the six-drum hall over the pty.

Runs with a recording and runs without one take turns, so that whole cycles can be compared as well.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import orjson

from bench.timing import DRIVE_ON, TIMEOUT_S, Timing, TimingPlan, finish, quantiles_of, start

LOOP: Final = "recording: loop time per cycle"
LOOP_CPU: Final = "recording: loop CPU time per cycle"
CYCLE: Final = "cycle, recording"
CYCLE_CONTROL: Final = "cycle, not recording"
LOOP_P99: Final = "recording: loop time per cycle, p99 µs"
HOUR_MB: Final = "recording: MB per hour"
DROPPED: Final = "recording: messages dropped"
SYNC: Final = "recording: longest fsync, ms"


def measure_recording(plan: TimingPlan, sets: Sequence[str], report: Callable[[str], None]) -> Timing:
    """Return the times of runs with and without a recording, run in turns.

    Parameters
    ----------
    plan : TimingPlan
        Duration and number of runs; background processes are not used.
    sets : sequence of str
        Settings of the run, as given to ``--set``.
    report : callable
        Called with a line on what is running.

    Raises
    ------
    UserError
        A run failed; the message holds the end of its error output.
    """
    walls_us: list[float] = []
    cpus_us: list[float] = []
    summaries: list[dict[str, Any]] = []
    controls: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="echolocate-bench-") as name:
        folder = Path(name)
        for turn in range(1, plan.rounds + 1):
            report(f"recording: {plan.seconds:g} s with a recording, turn {turn} of {plan.rounds}")
            summaries.append(_run(folder, plan.seconds, sets, "--record", str(folder / "hall.mcap")))
            for line in (folder / "samples.csv").read_text("ascii").splitlines():
                wall, cpu = line.split(",")
                walls_us.append(float(wall))
                cpus_us.append(float(cpu))
            report(f"recording: {plan.seconds:g} s without, turn {turn} of {plan.rounds}")
            controls.append(_run(folder, plan.seconds, sets, "--no-record"))
    rows = {LOOP: quantiles_of(walls_us), LOOP_CPU: quantiles_of(cpus_us)}
    rows |= {CYCLE: worst_cycle(summaries), CYCLE_CONTROL: worst_cycle(controls)}
    recordings = [summary["recording"] for summary in summaries]
    figures = {
        LOOP_P99: rows[LOOP]["p99"],
        HOUR_MB: round(max(hour_mb(one) for one in summaries), 1),
        DROPPED: float(max(one["dropped"] for one in recordings)),
        SYNC: round(1e3 * max(one["sync_max_s"] for one in recordings), 1),
    }
    return Timing(plan, rows, figures)


def hour_mb(summary: dict[str, Any]) -> float:
    """Return the disk space of an hour of such a run, MB."""
    seconds = 1e-6 * float(summary["timing"]["period"]) * int(summary["cycles"] + summary["missed"])
    return float(summary["recording"]["bytes"]) / 1e6 / seconds * 3600.0


def worst_cycle(summaries: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return the largest quantiles of the whole cycle, µs."""
    rows = [summary["cycle_us"] for summary in summaries]
    return {column: max(float(row[column]) for row in rows) for column in rows[0]}


def _run(folder: Path, seconds: float, sets: Sequence[str], *arguments: str) -> dict[str, Any]:
    summary = folder / "run.json"
    options = [option for text in sets for option in ("--set", text)]
    run = start(
        folder, "run", "bench.recording_probe", str(folder / "samples.csv"), "run", "--headless", "--seconds",
        f"{seconds}", "--json", str(summary), "--force", *arguments, *DRIVE_ON, *options,
    )  # fmt: skip
    finish(folder, run, "run", seconds + TIMEOUT_S)
    found: dict[str, Any] = orjson.loads(summary.read_bytes())
    return found
