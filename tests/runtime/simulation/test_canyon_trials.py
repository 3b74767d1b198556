"""Drives to a goal behind a canyon: what counts as an entry, and the row of the table."""

from __future__ import annotations

import pytest

from config.load import load_settings
from runtime.simulation.canyon_trials import CanyonOutcome, drive, summarise
from runtime.simulation.canyon_worlds import canyon_world


def outcome(
    depth_m: float, entries: int, *, arrived: bool = True, heard_m: float | None = None
) -> CanyonOutcome:  # fmt: skip
    reported_m = None if entries == 0 else -1.0
    return CanyonOutcome(depth_m, 2.0, arrived, entries, 1.0, 0, 15.0, 10.0, 60.0, reported_m, heard_m)


def test_the_row_counts_escapes_turns_and_entries() -> None:
    row = summarise("ours", "cone", [outcome(1.0, 1), outcome(4.0, 0), outcome(4.0, 2, arrived=False)])
    assert (row["worlds"], row["escaped"], row["deep"], row["turned"], row["entered_again"]) == (3, 2, 2, 1, 1)
    assert (row["way"], row["reported"], row["reported_outside"]) == (1.5, 2, 2)


def test_turns_are_counted_apart_where_the_back_is_heard_in_time() -> None:
    near, late = outcome(4.0, 1, heard_m=2.0), outcome(7.0, 1, heard_m=0.9)
    drives = [outcome(4.0, 0, heard_m=2.0), near, late, outcome(8.0, 1)]
    row = summarise("ours", "specular", [*drives, outcome(1.2, 0, heard_m=3.0)])
    assert (row["deep"], row["turned"], row["heard"], row["turned_heard"]) == (4, 1, 2, 1)


@pytest.mark.soak
def test_a_drive_escapes_and_turns_before_a_canyon() -> None:
    done = drive(load_settings("hallway"), canyon_world(0), 0)
    assert done.arrived
    assert done.contacts == 0
    assert done.way_m == pytest.approx(done.shortest_m, rel=0.5)
