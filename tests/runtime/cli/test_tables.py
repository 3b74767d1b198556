"""Tests of the printed tables: numbers in the right units, and what was not found."""

from __future__ import annotations

import io

import pytest
from rich.console import Console
from rich.table import Table

from runtime.cli.tables import objects_table, outcome_line, pose_line, table_2, timing_line, timing_table
from runtime.cycle.summary import ObjectRow, PoseRow, RunSummary
from runtime.simulation.evaluation import Outcome
from runtime.support.length_format import Units
from runtime.timing.cycle_stats import Spread
from runtime.timing.footprint import FootprintRow
from runtime.timing.timing_monitor import TimingSummary

OUTCOME: Outcome = {
    "drums": [
        {"truth": (0.3048, 1.2192), "estimate": (0.3048, 1.1582), "error": 0.061},
        {"truth": (1.2192, -1.2192), "estimate": None, "error": None},
    ],
    "false": 1,
    "mean_error": 0.061,
    "max_error": 0.061,
    "times_real_time": 79.4,
    "cycle_us": {"p50": 104.0, "p99": 310.0, "max": 900.0},
}


def shown(table: Table) -> list[str]:
    file = io.StringIO()
    Console(file=file, width=120).print(table)
    return file.getvalue().splitlines()


@pytest.mark.parametrize(
    ("units", "truth", "estimate", "error"),
    [("ft", "(1.00, 4.00)", "(1.00, 3.80)", "0.200"), ("m", "(0.30, 1.22)", "(0.30, 1.16)", "0.061")],
)
def test_table_2(units: Units, truth: str, estimate: str, error: str) -> None:
    lines = shown(table_2(OUTCOME, units))
    (first,) = (line for line in lines if truth in line)
    assert estimate in first
    assert error in first
    (missing,) = (line for line in lines if "not found" in line)
    assert missing.split("│")[1].strip() == "2"
    assert all(f"({units})" in line for line in lines if "truth" in line)


def test_result_line() -> None:
    assert outcome_line(OUTCOME, "ft") == (
        "1 of 2 drums found, 1 false, mean error 0.200 ft, max 0.200 ft; 79 times real time; "
        "a cycle takes 0.10 ms, p99 0.31 ms"
    )
    nothing: Outcome = {**OUTCOME, "drums": OUTCOME["drums"][1:], "mean_error": None, "max_error": None}
    assert outcome_line(nothing, "m").startswith("0 of 1 drums found, 1 false; 79 times real time; ")


@pytest.mark.parametrize(
    ("sigma_m", "said"), [(0.02, "± 0.020 m"), (0.001, "± 0.0010 m"), (0.0, "less than 0.0001 m")]
)
def test_no_place_is_known_to_nothing(sigma_m: float, said: str) -> None:
    covariance = [[sigma_m**2, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1e-6]]
    here: PoseRow = {
        "x": 1.0, "y": 2.0, "theta": 0.0, "covariance": covariance, "status": "tracking", "probability": 1.0,
    }  # fmt: skip
    assert said in pose_line(here, "m")


def test_objects() -> None:
    row: ObjectRow = {
        "model": "semicircle", "x": 0.3048, "y": -0.6096, "theta": -1.5707963, "sigma": 0.01, "support": 39,
        "score": 0.951, "number": 7,
    }  # fmt: skip
    (line,) = (line for line in shown(objects_table([row], "ft")) if "semicircle" in line)
    assert [cell.strip() for cell in line.split("│")[1:-1]] == [
        "7",
        "semicircle",
        "1.00",
        "−2.00",
        "−90°",
        "39",
        "0.95",
    ]
    assert any("x (m)" in line for line in shown(objects_table([], "m")))


def test_the_timing_table_and_the_causes_of_delays() -> None:
    spread: Spread = {"p50": 170.0, "p99": 1250.0, "p999": 8004.0, "max": 49_653.0}
    timing: TimingSummary = {
        "period": 50_000.0, "following": 0.9958, "late": spread, "echo_wait": spread, "phases": {"refine": spread},
        "callbacks": {"link receive": spread}, "overruns": 2, "missed": 1,
        "faults": {"outside the process": 6, "callback Recorder.flush": 1},
    }  # fmt: skip
    cost: FootprintRow = {
        "start_s": 0.9, "cpu_share": 0.03, "rss_mb": 190.0, "rss_peak_mb": 195.0, "growth_mb": 0.0, "compilations": 0,
        "collections": [0, 12, 0],
    }  # fmt: skip
    summary: RunSummary = {
        "objects": [], "walls": [], "corners": [], "canyons": [], "polylines": [], "cycles": 240,
        "process": cost, "cycle_us": spread, "late": 7, "missed": 1, "lag_us": spread,
        "link": {"frames": 0, "bad": 0, "lost": 0}, "sensors": [], "mode": "DRIVE", "stop_reasons": [],
        "hold_reasons": [], "mission": None, "preparing": None, "timing": timing,
    }  # fmt: skip
    console = Console(record=True, width=110, file=io.StringIO(), color_system=None)
    console.print(timing_table(summary))
    text = console.export_text()
    for piece in ("refine", "between cycles: link receive", "wait of an echo for its cycle", "p99.9"):
        assert piece in text, piece
    assert text.count("0.17") == text.count("1.25") == text.count("8.00") == text.count("49.65") == 4
    assert timing_line(summary) == (
        "240 cycles, 100% of them with the ring; 7 late, 1 missed, 2 overruns; "
        "caused by: outside the process (6), callback Recorder.flush (1)"
    )
    timing["faults"] = {}
    assert timing_line(summary).endswith("2 overruns")
