"""Tables of a timing measurement, with its limits and the comparison with an earlier run."""

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
"""Limit of the time from an echo to the command beyond the control's, at p99."""
LATE_MAX_US: Final = 1000.0
"""Limit of how late a cycle starts beyond the control's wake-up, at p99.9."""
LIMITS: Final = {
    "start_s": 2.5, "rss_mb": 250.0, "rss_peak_mb": 250.0, "cpu_share": 0.06,
    "compilations": 0.0, "full collections": 0.0, "link lost": 0.0, "stops": 0.0, WINDOW_USED: 0.03,
    VIRTUAL: 10.0, LOOP_P99: 300.0, HOUR_MB: 30.0, DROPPED: 0.0,
}  # fmt: skip
"""Limit of each figure."""

Earlier = Mapping[str, Any]


def read_earlier(path: str) -> Earlier:
    """Return the quantiles and figures of an earlier run.

    Raises
    ------
    UserError
        The file cannot be read, or was not written by `bench timing`.
    """
    try:
        earlier: Earlier = orjson.loads(Path(path).read_bytes())
        return {"quantiles_us": dict(earlier["quantiles_us"]), "figures": dict(earlier["figures"])}
    except OSError as error:
        raise UserError(f"--against {path}: cannot be read: {error.strerror}", WRONG_CALL) from error
    except (orjson.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise UserError(f"--against {path}: was not written by `bench timing --json`", WRONG_CALL) from error


def checks(timing: Timing) -> list[tuple[str, float, float]]:
    """Return the checks: name, figure and limit."""
    rows = timing.quantiles_us
    checked = [(name, timing.figures[name], limit) for name, limit in LIMITS.items() if name in timing.figures]
    if ECHO_TO_DRIVE in rows and ECHO_TO_DRIVE + CONTROL in rows:
        limit = ANSWER_MAX_US + rows[ECHO_TO_DRIVE + CONTROL]["p99"]
        checked.append((f"{ECHO_TO_DRIVE}, p99 µs", rows[ECHO_TO_DRIVE]["p99"], limit))
    if LATE in rows and WAKING + CONTROL in rows:
        limit = LATE_MAX_US + rows[WAKING + CONTROL]["p99.9"]
        checked.append(("a cycle starts late, p99.9 µs", rows[LATE]["p99.9"], limit))
    return checked


def quantiles_table(timing: Timing, earlier: Earlier | None) -> Table:
    """Return the table of quantiles, µs, with those of an earlier run if given."""
    plan = timing.plan
    title = f"timing, µs: {plan.rounds} × {plan.seconds:g} s over the pty, {plan.busy} busy processes"
    table = Table(title=title, title_justify="left")
    table.add_column("row")
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
    """Return the table of start-up time, memory, processor time and counts, with their limits."""
    limits = {name: limit for name, _, limit in checks(timing)}
    found = timing.figures | {name: figure for name, figure, _ in checks(timing)}
    table = Table(title="process: the worst of all rounds", title_justify="left")
    table.add_column("row")
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
