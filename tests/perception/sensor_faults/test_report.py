"""Sensor faults as text: the most severe one, its likely cause and the next action, in one line."""

from __future__ import annotations

import pytest

from perception.sensor_faults.report import CROSSTALK, FAILING, SILENT, STUCK, TOO_NEAR, describe_fault


@pytest.mark.parametrize(
    ("faults", "name", "text"),
    [
        (FAILING, "failing", "sensor 7 never answers when it should fire"),
        (STUCK, "stuck", "sensor 7 always answers 1.25 m although the base has moved on"),
        (
            SILENT,
            "silent",
            "they miss 20% of such looks, so the odds are 10^10 to 1",
        ),
        (CROSSTALK, "crosstalk", "sensor 7 reads short when it fires together with 3, 11 and not otherwise"),
        (FAILING | STUCK | SILENT | CROSSTALK, "failing", "check its cable and its board"),
        (STUCK | SILENT | CROSSTALK, "stuck", "look for something that hangs in front of it"),
        (TOO_NEAR | SILENT, "too_near", "sensor 7 answers ranges below ring.range_min_m"),
        (SILENT | CROSSTALK, "silent", "check that nothing covers it"),
        (CROSSTALK, "crosstalk", "fire them apart (ring.firing)"),
    ],
)
def test_the_most_severe_fault_is_described(faults: int, name: str, text: str) -> None:
    report = describe_fault(7, faults, 1.25, [3, 11], 15, 0.2)
    assert (report.sensor, report.fault) == (7, name)
    assert text in report.reason
    assert "\n" not in report.reason


def test_odds_are_said_no_greater_than_they_mean_anything() -> None:
    assert "the odds are more than 10^12 to 1" in describe_fault(7, SILENT, 1.25, [], 500, 0.2).reason
