"""The timing table, and the comparison with an earlier run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import orjson
from rich.table import Table

from bench.recording import DROPPED, HOUR_MB, LOOP_P99
from bench.timing import CONTROL, ECHO_TO_DRIVE, LATE, VIRTUAL, WAKING, WINDOW_USED, Timing
from config.errors import WRONG_CALL, UserError

COLUMNS: Final = ("p50", "p99", "p99.9", "max")
ANSWER_MAX_US: Final = 3000.0
"""From an echo to the command, beyond what the bare control takes, at p99."""
LATE_MAX_US: Final = 1000.0
"""After its time that a cycle begins, beyond what a bare loop's does, at p99.9."""
LIMITS: Final = {
    "start_s": 2.5, "rss_mb": 250.0, "rss_peak_mb": 250.0, "cpu_share": 0.06,
    "compilations": 0.0, "full collections": 0.0, "link lost": 0.0, "stops": 0.0, WINDOW_USED: 0.03,
    VIRTUAL: 10.0, LOOP_P99: 300.0, HOUR_MB: 30.0, DROPPED: 0.0,
}  # fmt: skip
"""What each figure may be at most."""

Earlier = Mapping[str, Any]


def read_earlier(path: str) -> Earlier:
    """Return the JSON of an earlier run.

    Raises
    ------
    UserError
        There is none at `path`, or it is something else.
    """
    try:
        earlier: Earlier = orjson.loads(Path(path).read_bytes())
        return {"quantiles_us": dict(earlier["quantiles_us"]), "figures": dict(earlier["figures"])}
    except OSError as error:
        raise UserError(f"--against {path}: cannot be read: {error.strerror}", WRONG_CALL) from error
    except (orjson.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise UserError(f"--against {path}: is not what `bench timing --json` writes", WRONG_CALL) from error


def verdicts(timing: Timing) -> list[tuple[str, float, float]]:
    """Return what was asked: a name, the figure, and the most it may be."""
    rows = timing.quantiles_us
    asked = [(name, timing.figures[name], limit) for name, limit in LIMITS.items() if name in timing.figures]
    if ECHO_TO_DRIVE in rows and ECHO_TO_DRIVE + CONTROL in rows:
        limit = ANSWER_MAX_US + rows[ECHO_TO_DRIVE + CONTROL]["p99"]
        asked.append((f"{ECHO_TO_DRIVE}, p99 µs", rows[ECHO_TO_DRIVE]["p99"], limit))
    if LATE in rows and WAKING + CONTROL in rows:
        limit = LATE_MAX_US + rows[WAKING + CONTROL]["p99.9"]
        asked.append(("a cycle begins after its time, p99.9 µs", rows[LATE]["p99.9"], limit))
    return asked


def quantiles_table(timing: Timing, earlier: Earlier | None) -> Table:
    """Return the quantiles, µs; beside each its earlier self where there is one."""
    plan = timing.plan
    title = f"timing, µs: {plan.rounds} × {plan.seconds:g} s over the pty, {plan.busy} busy processes beside"
    table = Table(title=title, title_justify="left")
    table.add_column("what")
    for column in COLUMNS:
        table.add_column(column, justify="right")
        if earlier is not None:
            table.add_column("before", justify="right", style="dim")
    for name, row in timing.quantiles_us.items():
        cells = [name]
        for column in COLUMNS:
            cells.append(_text(row.get(column)))
            if earlier is not None:
                cells.append(_text(earlier["quantiles_us"].get(name, {}).get(column)))
        table.add_row(*cells)
    return table


def figures_table(timing: Timing, earlier: Earlier | None) -> Table:
    """Return start-up, memory, processor time and counts, with what they may be at most."""
    limits = {name: limit for name, _, limit in verdicts(timing)}
    found = timing.figures | {name: figure for name, figure, _ in verdicts(timing)}
    table = Table(title="the process, the worst of all rounds", title_justify="left")
    table.add_column("what")
    for column in ("figure", "at most", ""):
        table.add_column(column, justify="right")
    if earlier is not None:
        table.add_column("before", justify="right", style="dim")
    for name, figure in found.items():
        limit = limits.get(name)
        kept = "" if limit is None else "kept" if figure <= limit else "[bold red]missed[/]"
        cells = [name, _text(figure), _text(limit), kept]
        if earlier is not None:
            cells.append(_text(earlier["figures"].get(name)))
        table.add_row(*cells)
    return table


def _text(figure: float | None) -> str:
    return "" if figure is None else f"{figure:.10g}" if abs(figure) < 100.0 else f"{figure:.0f}"
