"""Every keyframe of every honest run is adopted: the short form, and an hour of each robot in each world."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable

import pytest

from bench.keyframes import (
    GRIDS,
    METHODS,
    PLACES,
    ROBOTS,
    SURFACES,
    WORLDS,
    Adopted,
    adopt_all,
    main,
    once,
    runs,
    settings_of,
    shares_after,
)
from config.errors import DONE
from config.load import load_settings
from perception.snapshot import bounds_of
from runtime.cycle.preparation import fresh_state
from runtime.recording.snapshot_bounds import check_snapshot

pytestmark = pytest.mark.compiled

SHORT_S = 6.0
HOUR_S = 3600.0
ROWS = tuple(runs())
SHORT = tuple(once())


def check(found: Adopted, seconds: float, period_s: float) -> None:
    assert found.refused == []
    assert found.keyframes == int(seconds / period_s)


def test_any_two_values_meet_in_a_run() -> None:
    factors = (ROBOTS, METHODS, GRIDS, PLACES, WORLDS, SURFACES)
    for (i, some), (j, others) in itertools.combinations(enumerate(factors), 2):
        assert {(row[i], row[j]) for row in ROWS} == set(itertools.product(some, others))


def test_the_map_of_surfaces_meets_all_in_runs_that_keep_it() -> None:
    kept = [row for row in ROWS if row.method == "bayes" and row.surfaces == "always"]
    for i, values in enumerate((ROBOTS, ("bayes",), GRIDS, PLACES, WORLDS)):
        assert {row[i] for row in kept} == set(values)


def test_each_number_of_each_state_has_a_bound() -> None:
    for run in SHORT:
        settings = settings_of(run)
        perception = fresh_state(settings).perception
        snapshot = perception.snapshot()
        check_snapshot(snapshot, snapshot, bounds_of(perception))


def test_each_robot_drives_once_and_every_method_meets_every_grid() -> None:
    factors = (ROBOTS, METHODS, GRIDS, PLACES, WORLDS, SURFACES)
    assert tuple(run.robot for run in SHORT) == ROBOTS
    assert [set(column) for column in zip(*SHORT, strict=True)] == [set(values) for values in factors]
    assert {(run.method, run.grid) for run in SHORT} == set(itertools.product(METHODS, GRIDS))


@pytest.mark.parametrize(
    "seed",
    [pytest.param(k, marks=[] if k % 12 == 0 else [pytest.mark.soak]) for k in range(len(SHORT))],
)
def test_each_robot_drives_a_little_and_no_keyframe_is_refused(seed: int) -> None:
    """And no number would come near its bound in a day if it grew on as it does here."""
    settings = settings_of(SHORT[seed])
    found = adopt_all(settings, seed, SHORT_S, 1.0)
    check(found, SHORT_S, 1.0)
    share, name = shares_after(SHORT_S, found, settings)[0]
    assert share < 0.5, name


@pytest.mark.parametrize(
    ("run", "robot", "seconds", "sets"),
    [
        pytest.param("office", "denning", 6.0, (), marks=pytest.mark.soak),
        pytest.param("room", "p3dx", 6.0, ("perception.grid.method=off",), marks=pytest.mark.soak),
        ("room", "ears", 6.0, ("perception.grid.method=elfes",)),
    ],
)
def test_no_keyframe_of_the_shipped_runs_is_refused(
    run: str, robot: str, seconds: float, sets: tuple[str, ...]
) -> None:
    mission = "round-the-room" if run == "room" else None
    settings = load_settings(run, sets, robot=robot, mission=mission)
    check(adopt_all(settings, 0, seconds, 3.0), seconds, 3.0)


def test_a_refused_keyframe_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_of(ROWS[0])
    name = "canyon_map.firings"
    bounds = bounds_of(fresh_state(settings).perception)
    narrow = {**bounds, name: bounds[name]._replace(high=3)}
    monkeypatch.setattr("runtime.recording.replayer.bounds_of", lambda _: narrow)
    found = adopt_all(settings, 0, 3.0, 1.0)
    assert len(found.refused) == 2
    assert name in found.refused[0]


@pytest.mark.soak
def test_a_line_of_json_is_printed_for_each_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(seconds=41.0, robots=("amigo",), worlds=("hallway",)) == DONE
    (line,) = capsys.readouterr().out.splitlines()
    row = json.loads(line)
    assert (row["robot"], row["world"], row["keyframes"], row["refused"]) == ("amigo", "hallway", 1, [])
    assert row["way_m"] > 5.0


@pytest.mark.soak
@pytest.mark.parametrize("number", range(len(ROWS)), ids=lambda k: "-".join(ROWS[k]))
def test_no_keyframe_of_an_hour_is_refused(number: int, measured: Callable[[str], None]) -> None:
    settings = settings_of(ROWS[number])
    found = adopt_all(settings, number, HOUR_S, settings.recording.keyframe_period_s)
    check(found, HOUR_S, settings.recording.keyframe_period_s)
    share, name = shares_after(HOUR_S, found, settings)[0]
    assert share < 0.5, name
    measured(f"{found.keyframes} keyframes, 0 refused; {name} would take {share:.1g} of its bound after a day")
