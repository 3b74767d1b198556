"""Tests of bench.timing and bench.timing_table: echo-command pairs, worst figures, limits, earlier runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson
import pytest

from bench.control import wake
from bench.timing import (
    CONTROL,
    ECHO_TO_DRIVE,
    LATE,
    WAKING,
    WINDOW_USED,
    Timing,
    TimingPlan,
    answers_us,
    quantile_rows,
    quantiles_of,
    window_s,
    worst_figures,
    worst_rows,
)
from bench.timing_table import checks, figures_table, quantiles_table, read_earlier
from config.errors import UserError

PLAN = TimingPlan(1.0, 1, 0)


def trace(folder: Path, *rows: str) -> Path:
    path = folder / "latency.csv"
    path.write_text("\n".join(("host_s,frame", *rows, "")))
    return path


def test_echo_is_paired_with_the_next_command(tmp_path: Path) -> None:
    path = trace(
        tmp_path, "0.5,echo", "0.9,drive", "1.0,echo", "1.002,drive", "1.04,drive", "2.0,echo", "3.0,echo",
        "3.001,drive", "4.0,echo",
    )  # fmt: skip
    taken_us, unanswered = answers_us(path)
    assert taken_us == pytest.approx([2000.0, 1000.0], abs=0.1)
    assert unanswered == 1, "the second echo; those before the first command and after the last do not count"


def test_trace_without_commands_has_no_pairs(tmp_path: Path) -> None:
    assert answers_us(trace(tmp_path, "1.0,echo", "2.0,echo")) == ([], 0)


def test_every_row_of_quantiles_in_a_summary_is_found() -> None:
    row = {"p50": 1.0, "p99": 2.0, "max": 3.0}
    summary = {"cycle_us": row, "phases_us": {"decide": row}, "link": {"bad": 0}, "mode": "DRIVE", "late": 3}
    assert quantile_rows(summary) == {"cycle": row, "phases: decide": row}
    worse = {"cycle_us": {"p50": 0.5, "p99": 9.0, "max": 9.0}}
    assert worst_rows([summary, worse])["cycle"] == {"p50": 1.0, "p99": 9.0, "max": 9.0}


def test_figures_are_the_worst_of_all_runs() -> None:
    def summary(**process: Any) -> dict[str, Any]:
        defaults = {"start_s": 1.0, "rss_mb": None, "collections": [0, 5, 0]}
        return {
            "process": defaults | process,
            "link": {"lost": 0},
            "late": 0,
            "missed": 2,
            "stop_reasons": [],
            "mode": "DRIVE",
        }

    figures = worst_figures([summary(), summary(start_s=2.0, collections=[0, 0, 1])])
    assert figures == {
        "start_s": 2.0, "full collections": 1.0, "link lost": 0.0, "late": 0.0, "missed": 2.0,
        "stops": 0.0, "ended outside DRIVE": 0.0,
    }  # fmt: skip


def timed(p99: float, control: float) -> Timing:
    rows = {ECHO_TO_DRIVE: quantiles_of([p99]), ECHO_TO_DRIVE + CONTROL: quantiles_of([control])}
    return Timing(PLAN, rows, {"start_s": 2.0, "cpu_share": 0.07})


def test_a_control_writes_how_late_it_woke_and_how_long_it_worked(tmp_path: Path) -> None:
    wake(0.001, 0.01, tmp_path / "woken.csv")
    rows = [line.split(",") for line in (tmp_path / "woken.csv").read_text("ascii").splitlines()]
    assert len(rows) == 10
    assert all(float(late) >= 0.0 and float(worked) > 0.0 for late, worked in rows)


def test_echo_to_drive_limit_is_three_milliseconds_beyond_the_control() -> None:
    limits = {name: (figure, limit) for name, figure, limit in checks(timed(3400.0, 500.0))}
    assert limits[f"{ECHO_TO_DRIVE}, p99 µs"] == pytest.approx((3400.0, 3500.0))
    assert limits["start_s"] == (2.0, 2.5)
    assert limits["cpu_share"] == (0.07, 0.06)


def test_cycle_start_limit_is_one_millisecond_beyond_the_control() -> None:
    rows = {LATE: quantiles_of([1900.0]), WAKING + CONTROL: quantiles_of([1000.0])}
    assert checks(Timing(PLAN, rows, {WINDOW_USED: 0.02})) == [
        (WINDOW_USED, 0.02, 0.03),
        ("a cycle starts late, p99.9 µs", 1900.0, 2000.0),
    ]


def test_window_is_the_flight_time_of_the_farthest_echo() -> None:
    assert window_s([]) == pytest.approx(0.0453, abs=1e-4)


def test_earlier_run_is_compared(tmp_path: Path) -> None:
    path = tmp_path / "earlier.json"
    path.write_bytes(orjson.dumps(timed(3000.0, 400.0).as_json()))
    earlier = read_earlier(str(path))
    current = timed(3400.0, 500.0)
    assert quantiles_table(current, earlier).row_count == 2
    assert [list(column.cells) for column in figures_table(current, earlier).columns][3][:2] == [
        "kept",
        "[bold red]missed[/]",
    ]
    before = [list(column.cells) for column in quantiles_table(current, earlier).columns][2]
    assert before == ["3000", "400"]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"quantiles_us": 3, "figures": 4}'])
def test_other_file_is_refused_as_earlier_run(text: str, tmp_path: Path) -> None:
    path = tmp_path / "earlier.json"
    path.write_text(text)
    with pytest.raises(UserError, match="was not written by"):
        read_earlier(str(path))
    with pytest.raises(UserError, match="cannot be read"):
        read_earlier(str(tmp_path / "none.json"))
