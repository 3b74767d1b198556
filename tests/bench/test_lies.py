"""Robots that lie: what their own motion or clock contradicts is named, and nothing is touched at speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import product

import numpy as np
import pytest

from bench.lies import (
    BUILT,
    KINDS,
    ROBOTS,
    Plan,
    TrialResult,
    honest,
    lies_table,
    make_lie,
    measure,
    run_trial,
    trials,
)
from config.load import list_shipped, load_robot, load_settings
from perception.ring_faults.monitor import REASONS as RING_REASONS
from runtime.cycle.modes import CLOCK_REASONS

pytestmark = pytest.mark.compiled
promised = pytest.mark.promise("P8")

RING = ("frozen", "dropped")
CLOCKS = tuple(kind for kind in KINDS if "clock" in kind)
HOUSE = ("room", "office", "hallway", "furnished")


def drawn(kinds: Iterable[str], count: int, seed: int) -> list[Plan]:
    """Return random trials of the kinds, without the clocks of robots that have none."""
    rng = np.random.default_rng(seed)
    every = list(trials(ROBOTS, HOUSE, tuple(kinds), range(3), 5))
    return [every[k] for k in rng.choice(len(every), count, replace=False).tolist()]


def assert_found(results: Iterable[TrialResult]) -> None:
    assert [one for one in results if one.is_contact] == []
    assert [one for one in results if one.named_s is None and one.is_driving] == []


@pytest.mark.parametrize(
    "room", ["room", *(pytest.param(one, marks=pytest.mark.soak) for one in ("furnished", "corridor"))]
)
def test_an_honest_robot_drives_without_recognition(room: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that stands would show nothing about lies."""
    monkeypatch.setattr("bench.lies.HONEST_S", 8.0)
    result = run_trial("p3dx", room, None, 1, 0)
    assert result.way_m > 0.2
    assert result.said is None


def summed_up(results: list[TrialResult]) -> str:
    named = [one.named_s for one in results if one.named_s is not None]
    contacts, driving = sum(one.is_contact for one in results), sum(one.is_driving for one in results)
    return (
        f"{len(results)} drives, {driving} of which moved on: {contacts} contacts above 0.05 m/s, "
        f"{len(named)} named, after {np.median(named):.1f} s (median), at most {max(named):.1f} s"
    )


@promised
def test_a_robot_with_a_wrong_clock_stops_by_name(
    measured: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One drive of each kind, short: the seeds are those of robots that drive as their clock becomes wrong.

    A clock in steps shows only by the echoes that are dropped: after 2.4 s at most in most drives, 5.4 s in others.
    """
    monkeypatch.setattr("bench.lies.UNTIL_S", 8.0)
    plans = [
        plan for kind, seed in zip(CLOCKS, (56, 57, 58, 59, 61, 62), strict=True) for plan in drawn([kind], 1, seed)
    ]
    results = measure(plans, lambda _: None)
    assert [one.kind for one in results if one.speed_m_s > 0.2] == list(CLOCKS)
    assert_found(results)
    late = {str(one.kind) for one in results if one.named_s is None or one.named_s > 1.0}
    assert late <= {"clock in steps"}
    assert max(one.named_s or math.inf for one in results) < 8.0
    measured(summed_up(results))


@promised
@pytest.mark.promise("P24")
@pytest.mark.parametrize(("count", "until_s"), [(2, 9.0), pytest.param(4, 25.0, marks=pytest.mark.soak)])
def test_a_ring_that_lies_is_named_and_nothing_is_touched(
    count: int, until_s: float, measured: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bench.lies.UNTIL_S", until_s)
    results = measure(drawn(RING, count, 2), lambda _: None)
    assert any(one.is_driving for one in results), "a robot that stands would show nothing"
    assert_found(results)
    measured(summed_up(results))


@promised
@pytest.mark.parametrize(
    "plan",
    [
        pytest.param(("hobby3", "corridor", "silent", 33100, 0), marks=pytest.mark.soak),
        ("hobby8", "corridor", "silent", 33100, 2),
        pytest.param(("parking12", "corridor", "frozen", 33100, 0), marks=pytest.mark.soak),
    ],
)
def test_few_sensors_that_fail_between_mirrors_touch_nothing_at_speed(plan: Plan) -> None:
    """Their silence is nothing new there: each of these drives touched a wall at .2 m/s or more, unnamed."""
    assert_found(measure([plan], lambda _: None))


@promised
@pytest.mark.soak
def test_lies_of_every_shipped_robot(measured: Callable[[str], None]) -> None:
    results = measure(trials(ROBOTS, HOUSE, (*RING, *CLOCKS), range(1), 5), lambda _: None)
    assert_found(results)
    measured(summed_up(results))


@promised
@pytest.mark.soak
def test_no_honest_drive_is_stopped_as_for_a_lie(measured: Callable[[str], None]) -> None:
    results = measure(honest(ROBOTS, HOUSE, range(14), 1), lambda _: None)
    lies = {*CLOCK_REASONS.values(), *RING_REASONS.values()} - {None}
    assert [one for one in results if one.said in lies] == []
    hours, others = sum(one.drive_s for one in results) / 3600.0, sum(one.named_s is not None for one in results)
    measured(f"{len(results)} honest drives, {hours:.1f} h: 0 stops as for a lie, {others} for other reasons")


def test_an_honest_drive_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.lies.HONEST_S", 10.0)
    result = run_trial("p3dx", "furnished", None, 0, 0)
    assert (result.named_s, result.contact_s, result.is_contact) == (None, None, False)
    assert result.drive_s == pytest.approx(10.0, abs=0.1)


def test_trials_and_their_table() -> None:
    every = list(trials(("denning", "p3dx"), ("room",), ("frozen", "latched clock"), range(2), 1))
    assert every == [
        *(("denning", "room", kind, seed, 0) for seed, kind in product(range(2), ("frozen", "latched clock"))),
        *(("p3dx", "room", "frozen", seed, 0) for seed in range(2)),
    ]
    result = TrialResult("p3dx", "room", "frozen", 0, 0, 9.0, 0.3, 0.2, 1.5, None, None, 12.0, 0.9)
    table = lies_table([result])
    assert [column.header for column in table.columns] == ["lie", "p3dx"]
    assert list(table.columns[1].cells) == ["1 1/1"]


def test_a_fault_of_the_sensor_on_a_servo_is_one_at_all_its_bearings() -> None:
    settings = load_settings("room", robot="servo1")
    assert make_lie("one deaf", settings, 0.0).model_dump()["sensors"] == tuple(range(60))
    assert make_lie("one deaf", load_settings("room", robot="hobby3"), 0.0).model_dump()["sensors"] == (1,)
    every = (*BUILT, *KINDS)
    kinds = [kind for _, _, kind, _, _ in trials(("servo1",), ("room",), every, range(1), 1)]
    assert [kind for kind in every if kind not in kinds] == ["two exchanged", "frozen but one", "exchanged"]


def test_all_sensors_but_one_are_all_but_the_one_that_is_said() -> None:
    settings = load_settings("room", robot="hobby3")
    assert make_lie("frozen but one", settings, 0.0).model_dump()["sensors"] == (0, 2)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_is_a_fault_that_begins_then(kind: str) -> None:
    settings = load_settings("room")
    lie = make_lie(kind, settings, 4.5)
    assert lie.at_s == 4.5
    assert getattr(lie, "range_m", 0.0) <= settings.ring.range_max_m


def test_all_shipped_robots_are_driven() -> None:
    assert all(load_robot(name).body.radius_m > 0.0 for name in ROBOTS)
    assert list_shipped("robots") == ROBOTS


@pytest.mark.parametrize("kind", ["one deaf", "one backwards", "one at 1 m"])
def test_a_fault_that_a_robot_is_built_with_is_named_in_its_first_turn(kind: str) -> None:
    result = run_trial("hobby3", "room", kind, 1, 0)
    assert result.began_s == 0.0
    assert result.named_s is not None
    assert result.named_s < 6.0
    assert not result.is_contact


@pytest.mark.parametrize("kind", ["turned 90", "turned 180"])
def test_only_what_says_that_a_ring_is_turned_names_it(kind: str) -> None:
    """A sensor that is reported, or a ring that hears nothing new, would be named as another fault."""
    results = [run_trial("hobby8", room, kind, 181000, moment) for room, moment in (("corridor", 0), ("room", 1))]
    assert [one.said for one in results if one.said is not None and "turned" not in one.said] == []
    assert results[0].said is not None
