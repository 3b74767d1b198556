"""Timing of a run: the real command on a real pseudo-terminal, in turns with minimal control programs.

Every row of quantiles in the run's summary enters the table, so new rows appear by themselves. The time from an echo
to the command that follows it is measured on the robot's side of the line, see `drivers/emulator/latency_trace.py`.
"""

from __future__ import annotations

import contextlib
import csv
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import orjson

from bench.waking import PERIOD_S, busy_processes
from config.errors import FAILED, UserError
from config.load import load_settings
from config.robot import SOUND_SPEED_M_S
from runtime.simulation.closed_loop import simulate

ECHO_TO_DRIVE: Final = "echo to drive"
LATE: Final = "timing: late"
"""Row of how late cycles started."""
WINDOW_USED: Final = "firing window used, p99 share"
START_CONTROL: Final = "start_s, control"
VIRTUAL: Final = "one second of virtual time, CPU ms"
VIRTUAL_S: Final = 20.0
WAKING: Final = "lag"
CYCLE: Final = "cycle"
CONTROL: Final = ", control"
TIMEOUT_S: Final = 90.0
QUANTILES: Final = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
RENAMED: Final = MappingProxyType({"p999": "p99.9"})
DRIVE_ON: Final = ("--set", "behaviors.move_ahead.at_end=turn_back")
"""The robot turns back at the end of the hall, so that a measurement of any length drives past drums."""

Quantiles = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class TimingPlan:
    """Extent of a measurement: `rounds` times `seconds` of our run and of the control, with `busy` processes."""

    seconds: float
    rounds: int
    busy: int


@dataclass(frozen=True, slots=True)
class Timing:
    """Result of a measurement."""

    plan: TimingPlan
    quantiles_us: dict[str, dict[str, float]]
    """Quantiles of each row, µs."""
    figures: dict[str, float]
    """Start-up time, memory, processor time and counts: the worst of all rounds."""

    def as_json(self) -> dict[str, Any]:
        """Return the result as written to a JSON file."""
        plan = {"seconds": self.plan.seconds, "rounds": self.plan.rounds, "busy": self.plan.busy}
        return {"plan": plan, "quantiles_us": self.quantiles_us, "figures": self.figures}


def measure_timing(plan: TimingPlan, sets: Sequence[str], report: Callable[[str], None]) -> Timing:
    """Return the timing of our run and of the controls, run in turns.

    Parameters
    ----------
    plan : TimingPlan
        Duration and number of runs.
    sets : sequence of str
        Settings of the run, as given to ``--set``.
    report : callable
        Called with a line on what is running.

    Raises
    ------
    UserError
        A process failed; the message holds the end of its error output.
    """
    summaries: list[dict[str, Any]] = []
    samples: dict[str, list[float]] = {
        name: [] for name in (WAKING + CONTROL, CYCLE + CONTROL, ECHO_TO_DRIVE, ECHO_TO_DRIVE + CONTROL)
    }
    unanswered, imports_s = 0, []
    with tempfile.TemporaryDirectory(prefix="echolocate-bench-") as name, busy_processes(plan.busy):
        folder = Path(name)
        for turn in range(1, plan.rounds + 1):
            report(f"timing: ours, {plan.seconds:g} s, turn {turn} of {plan.rounds}, {plan.busy} busy processes")
            summary, woken_us = _ours(folder, plan.seconds, sets)
            summaries.append(summary)
            imports_s.append(_import_s())
            samples[WAKING + CONTROL] += [late for late, _ in woken_us]
            samples[CYCLE + CONTROL] += [worked for _, worked in woken_us]
            answers, missing = answers_us(folder / "latency.csv")
            samples[ECHO_TO_DRIVE] += answers
            unanswered += missing
            report(f"timing: control, {plan.seconds:g} s, turn {turn} of {plan.rounds}")
            _control(folder, plan.seconds, sets)
            samples[ECHO_TO_DRIVE + CONTROL] += answers_us(folder / "latency.csv")[0]
    rows = worst_rows(summaries)
    rows |= {name: quantiles_of(taken) for name, taken in samples.items() if taken}
    figures = worst_figures(summaries) | {
        WINDOW_USED: round(rows[CYCLE]["p99"] / (1e6 * window_s(sets)), 4),
        START_CONTROL: round(max(imports_s), 2),
        VIRTUAL: virtual_ms(sets, plan.rounds),
        "echoes unanswered": float(unanswered),
    }
    return Timing(plan, dict(sorted(rows.items())), figures)


def window_s(sets: Sequence[str]) -> float:
    """Return how long the ring listens after a firing, s: the time available for a cycle's work."""
    ring = load_settings("hallway", sets).ring
    return 2.0 * ring.window_m / SOUND_SPEED_M_S


def answers_us(trace: Path) -> tuple[list[float], int]:
    """Return the time from each echo to the next command, µs, and the number of echoes that got none.

    Echoes before the first command, and the last echo, do not count.
    """
    with trace.open(encoding="ascii", newline="") as file:
        rows = [(float(row["host_s"]), row["frame"]) for row in csv.DictReader(file)]
    first = next((k for k, (_, frame) in enumerate(rows) if frame == "drive"), len(rows))
    last = max((k for k, (_, frame) in enumerate(rows) if frame == "drive"), default=0)
    taken_us: list[float] = []
    unanswered, echo_s = 0, None
    for host_s, frame in rows[first : last + 1]:
        if frame == "echo":
            unanswered += echo_s is not None
            echo_s = host_s
        elif echo_s is not None:
            taken_us.append(1e6 * (host_s - echo_s))
            echo_s = None
    return taken_us, unanswered


def quantiles_of(taken_us: Sequence[float]) -> dict[str, float]:
    """Return the quantiles of samples, µs."""
    values = np.quantile(taken_us, list(QUANTILES.values()))
    row = {name: round(float(value), 1) for name, value in zip(QUANTILES, values, strict=True)}
    return row | {"max": round(float(max(taken_us)), 1)}


def quantile_rows(summary: Mapping[str, Any], prefix: str = "") -> dict[str, dict[str, float]]:
    """Return every row of quantiles (µs) in a summary, at any depth, by its name."""
    rows: dict[str, dict[str, float]] = {}
    for key, value in summary.items():
        if not isinstance(value, dict):
            continue
        name = f"{prefix}{key.removesuffix('_us')}"
        if "p50" in value:
            rows[name] = {RENAMED.get(column, column): float(figure) for column, figure in value.items()}
        else:
            rows |= quantile_rows(value, f"{name}: ")
    return rows


def worst_rows(summaries: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the largest quantiles of each row over all summaries."""
    rows: dict[str, dict[str, float]] = {}
    for summary in summaries:
        for name, row in quantile_rows(summary).items():
            before = rows.setdefault(name, row)
            rows[name] = {column: max(figure, before.get(column, figure)) for column, figure in row.items()}
    return rows


def worst_figures(summaries: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the largest of each number in the process rows and counts of all summaries."""
    figures: dict[str, float] = {}
    for summary in summaries:
        process = summary["process"]
        plain = {name: value for name, value in process.items() if isinstance(value, int | float)}
        plain |= {"full collections": process["collections"][-1], "link lost": summary["link"]["lost"]}
        plain |= {name: summary[name] for name in ("late", "missed")}
        plain |= {"stops": len(summary["stop_reasons"]), "ended outside DRIVE": summary["mode"] != "DRIVE"}
        for name, value in plain.items():
            figures[name] = max(float(value), figures.get(name, float(value)))
    return figures


def _ours(folder: Path, seconds: float, sets: Sequence[str]) -> tuple[dict[str, Any], list[tuple[float, float]]]:
    """Run the command with a control; return the summary, and how late the control woke and what it took then, µs."""
    summary, woken = folder / "run.json", folder / "woken.csv"
    options = [option for text in sets for option in ("--set", text)]
    with emulating(folder, options) as port:
        run = start(
            folder, "run", "runtime.cli", "run", "--headless", "--port", port, "--arm", "--seconds", f"{seconds}",
            "--json", str(summary), "--force", *DRIVE_ON, *options,
        )  # fmt: skip
        control = start(folder, "wake", "bench.control", "wake", f"{PERIOD_S}", f"{seconds}", str(woken))
        for process, name in ((run, "run"), (control, "wake")):
            finish(folder, process, name, seconds + TIMEOUT_S)
    found: dict[str, Any] = orjson.loads(summary.read_bytes())
    with woken.open(encoding="ascii", newline="") as file:
        return found, [(float(late), float(worked)) for late, worked in csv.reader(file)]


def virtual_ms(sets: Sequence[str], rounds: int) -> float:
    """Return the CPU time of one second of the closed loop in virtual time, with acoustics, ms: the best round."""
    settings = load_settings("hallway", (*sets, DRIVE_ON[1]))
    if settings.world is None:
        return math.nan
    took_s = []
    for _ in range(1 + rounds):  # the first round allocates what is allocated on first use
        begin_s = time.thread_time()
        simulate(settings, settings.world, 0, VIRTUAL_S)
        took_s.append(time.thread_time() - begin_s)
    return round(1e3 * min(took_s) / VIRTUAL_S, 2)


def _import_s() -> float:
    """Return the time of an interpreter that only imports numba, s: a lower bound of the start-up time."""
    begin_s = time.monotonic()
    subprocess.run([sys.executable, "-c", "import numba"], check=True, timeout=TIMEOUT_S)
    return time.monotonic() - begin_s


def _control(folder: Path, seconds: float, sets: Sequence[str]) -> None:
    options = [option for text in sets for option in ("--set", text)]
    with emulating(folder, options) as port:
        process = start(folder, "answer", "bench.control", "answer", port, f"{seconds}", *options)
        finish(folder, process, "answer", seconds + TIMEOUT_S)


@contextlib.contextmanager
def emulating(folder: Path, options: Sequence[str]) -> Iterator[str]:
    """Run the emulator and yield its port; its latency trace is complete afterwards."""
    port, trace = folder / "robot", folder / "latency.csv"
    process = start(
        folder, "emulate", "runtime.cli", "emulate", "--link", str(port), "--latency", str(trace), "--force",
        *options,
    )  # fmt: skip
    try:
        end_s = time.monotonic() + TIMEOUT_S
        while not port.exists():
            if process.poll() is not None or time.monotonic() > end_s:
                raise UserError(f"the emulator did not start: {_error_output(folder, 'emulate')}", FAILED)
            time.sleep(0.02)
        yield str(port)
        process.send_signal(signal.SIGTERM)
        finish(folder, process, "emulate", TIMEOUT_S)
    finally:
        process.kill()
        process.wait()


def start(folder: Path, name: str, module: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Return a process that runs a module and keeps its state and its error output in a folder.

    Parameters
    ----------
    folder
        Folder for the state and for ``NAME.err``.
    name
        Name of the process.
    module
        Module to run.
    arguments
        Its arguments.
    """
    env = {**os.environ, "XDG_STATE_HOME": str(folder), "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    with (folder / f"{name}.err").open("wb") as err:
        command = [sys.executable, "-m", module, *arguments]
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=err, env=env)


def finish(folder: Path, process: subprocess.Popen[bytes], name: str, timeout_s: float) -> None:
    """Wait until a process that `start` returned has ended.

    Parameters
    ----------
    folder
        Folder that holds ``NAME.err``.
    process
        The process.
    name
        Its name.
    timeout_s
        Time after which it is killed, s.

    Raises
    ------
    UserError
        It failed; the message holds the end of its error output.
    """
    try:
        code = process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        code = process.wait()
    if code != 0:
        raise UserError(f"`{name}` exited with {code}: {_error_output(folder, name)}", FAILED)


def _error_output(folder: Path, name: str) -> str:
    return " ".join((folder / f"{name}.err").read_text("utf-8", errors="replace").split()[-40:])
