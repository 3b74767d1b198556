"""No number of a keyframe reaches a kernel unchecked: a poisoned one is refused, or is harmless."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.load import load_settings, with_known_room
from config.settings import Settings
from drivers.messages import Firing
from perception.bounds import Bound
from perception.paper.outline_map import PINNED
from perception.pipeline import Perception
from perception.snapshot import Snapshot, bounds_of, is_scratch, numbers_of
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import KEYFRAME, decode, encode
from runtime.recording.reader import open_recording, parse_settings
from runtime.recording.replayer import Replayer
from runtime.recording.schema import Keyframe, carried_state, keyframe, perception_snapshot, state_fields
from runtime.recording.snapshot_bounds import check_snapshot
from runtime.simulation.closed_loop import simulate
from tests.perception.halls import drive
from tests.recorded import entries_of, rewrite
from tests.runtime.recording.moments import (
    FOLLOWING,
    OUT_OF_BOUNDS,
    POISONED_CYCLE,
    Moment,
    changed,
    ends_in_error,
    moments_of,
)

CHECKED_EVERY = 26
"""Cycles from one check of an honest state to the next."""
SERVO_CYCLE = 200
"""By then the robot has driven past what its sensor hears."""
BOUNDS_CHECKED = os.environ.get("NUMBA_BOUNDSCHECK", "0") not in {"", "0"}
JOB = "method.memory.state.job."


def is_honest(perception: Perception, settings: Settings) -> None:
    """Adopt a state as a replay does."""
    other = fresh_state(settings).perception
    snapshot = perception.snapshot()
    check_snapshot(snapshot, other.snapshot(), bounds_of(other))
    other.restore(snapshot)


@pytest.mark.compiled
@pytest.mark.promise("P21")
def test_no_state_of_an_edited_run_is_refused(edited: Path, measured: Callable[[str], None]) -> None:
    checked = 0
    with open_recording(edited) as recording:
        replayer = Replayer(recording)
        for step in replayer:
            if step.replayed is not None and step.replayed.cycle % CHECKED_EVERY == 0:
                assert replayer.state is not None
                settings = parse_settings(replayer.settings_data)
                is_honest(replayer.state.perception, settings)
                checked += 1
    assert checked == 520 // CHECKED_EVERY
    measured(f"{checked} states of a run with every kind of edit: 0 refused")


@pytest.mark.compiled
@pytest.mark.parametrize("method", ["bayes", pytest.param("paper", marks=pytest.mark.soak)])
def test_no_state_among_irregular_objects_is_refused(method: str) -> None:
    settings = load_settings("irregular", [f"perception.method={method}"], models=("box", "semicircle"))
    assert settings.world is not None
    kinds = set()

    def on_state(record: CycleRecord, state: State, _start: object) -> None:
        if record.cycle % CHECKED_EVERY == 0:
            is_honest(state.perception, settings)
        if method == "bayes":
            kinds.add(int(state.perception.snapshot()["method.memory.state"]["job"]["kind"][0]))

    simulate(settings, settings.world, 2, 15.0, on_state=on_state)
    assert method == "paper" or len(kinds) == 3, "polygons are initiated and refined"


def faulty(firings: Iterator[Firing]) -> Iterator[Firing]:
    """Let a sensor be dead, one stuck, one deaf and one hear crosstalk now and then."""
    rng = np.random.default_rng(7)
    for firing in firings:
        ranges = firing.ranges_m.copy()
        ranges[3] = math.nan
        for sensor, value in ((5, 1.2), (8, math.inf), (11, 0.4 if rng.random() < 0.5 else ranges[11])):
            if not math.isnan(ranges[sensor]):
                ranges[sensor] = value
        yield Firing(firing.robot_s, firing.pose, firing.ring_yaw, ranges)


@pytest.mark.compiled
def test_no_state_with_correction_of_drift_is_refused() -> None:
    settings = load_settings("hallway", ["perception.localization.correct_drift=true"])
    assert settings.world is not None
    perception = Perception(settings.ring, settings.models, settings.perception)
    for k, firing in enumerate(faulty(drive(settings.world))):
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        if k % CHECKED_EVERY == 0:
            is_honest(perception, settings)
    localized = perception.localized()
    assert localized is not None
    assert localized.status == "tracking"


@pytest.mark.compiled
@pytest.mark.boundslong
@pytest.mark.parametrize(
    ("place", "grid", "method"),
    [("drift", "directed", "bayes"), *(pytest.param(*one, marks=pytest.mark.soak) for one in
     [("room", "off", "paper"), ("room", "moravec_elfes", "bayes"), ("drift", "elfes", "bayes")])],
)  # fmt: skip
def test_no_state_with_a_place_and_a_grid_is_refused_and_a_poisoned_one_is_harmless(
    place: str, grid: str, method: str
) -> None:
    sets = [f"perception.method={method}", f"perception.grid.method={grid}", "perception.grid.cells=32"]
    sets.append(f"perception.localization.correct_drift={str(place == 'drift').lower()}")
    settings = load_settings("irregular", sets)
    if place == "room":
        settings = with_known_room(settings, "irregular")
    assert settings.world is not None
    perception, rng = Perception(settings.ring, settings.models, settings.perception), np.random.default_rng(3)
    fresh, firings = perception.snapshot(), faulty(drive(settings.world, (-6.0, 2.0)))
    stages, last = set(), State(perception)
    for k, firing in enumerate(firings):
        perception.observe(firing)
        for _ in range(40):
            perception.refine()
        if k % CHECKED_EVERY == 0:
            is_honest(perception, settings)
            moment = Moment(k, settings, carried_state(last), perception.snapshot(), [])
            stages.add(int(moment.snapshot.get("known_room._stage", np.array(k))))
            poisoned = randomised(moment, rng)
            other = moment.perception()
            with contextlib.suppress(ArithmeticError, LookupError, ValueError):
                check_snapshot(poisoned, fresh, moment.bounds())
                other.restore(poisoned)
                other.observe(firing)
                for _ in range(40):
                    other.refine()
                other.localized()
                other.occupancy()
                other.labelled_objects()
    assert len(stages) >= 2
    localized = perception.localized()
    assert localized is not None
    assert localized.status == "tracking"


@pytest.mark.compiled
@pytest.mark.parametrize("method", ["bayes", pytest.param("paper", marks=pytest.mark.soak)])
def test_no_state_with_faulty_sensors_is_refused(method: str) -> None:
    settings = load_settings("hallway", [f"perception.method={method}"], models=("box",))
    assert settings.world is not None
    perception = Perception(settings.ring, settings.models, settings.perception)
    for k, firing in enumerate(faulty(drive(settings.world))):
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        if k == 300:
            perception.reset()
        if k % CHECKED_EVERY == 0:
            is_honest(perception, settings)
    assert {report.sensor for report in perception.sensor_reports()} >= {3, 5}


def poisons(values: np.ndarray[Any, Any], bound: Bound) -> list[float]:
    """Return what to put into a field: the ends of its bound, what lies beyond, and numbers of any size."""
    low, high = (int(end) for end in bound[:2]) if values.dtype.kind == "i" else bound[:2]
    if values.dtype.kind == "f":
        largest = float(np.finfo(values.dtype).max)
        return [max(low, -largest), min(high, largest), math.nan, math.inf, -math.inf, largest, -largest]
    if values.dtype.kind in {"b", "u"}:
        return [0, 1, 2, 255]
    of = np.iinfo(values.dtype)
    return sorted({n for n in (low, high, low - 1, high + 1, -1, of.min, of.max) if of.min <= n <= of.max})


def poison_all(moment: Moment, is_replayed: Callable[[str], bool]) -> Counter[str]:
    """Put each number into each field, everywhere and in its last place; replay what is not refused.

    Return how often a number was refused, how often the replay ended in an error of one line, and how often not.
    """
    found = Counter[str]()
    snapshot = {name: array.copy() for name, array in moment.snapshot.items()}
    numbers, fresh = dict(numbers_of(snapshot)), dict(numbers_of(moment.perception().snapshot()))
    bounds = moment.bounds()
    for name, values in numbers.items():
        if is_scratch(name) or values.size == 0:  # of a ring without a servo
            continue
        before, raw = values.copy(), values.view(np.uint8) if values.dtype.kind == "b" else values
        places: tuple[Any, ...] = (..., (-1,) * values.ndim)
        for number, place in itertools.product(poisons(values, bounds[name]), places):
            raw[place] = number
            try:
                check_snapshot({name: values}, {name: fresh[name]}, bounds)
            except ValueError:
                found["refused"] += 1
            else:
                if place is ... and is_replayed(name):
                    found["ended" if ends_in_error(moment, snapshot) else "harmless"] += 1
            values[...] = before
    return found


@pytest.fixture(scope="module")
def moments(edited: Path) -> dict[int, Moment]:
    return {moment.cycle: moment for moment in moments_of(edited)}


@pytest.mark.compiled
@pytest.mark.boundscheck
@pytest.mark.promise("P21")
@pytest.mark.parametrize("share", [pytest.param(1, marks=pytest.mark.soak, id="all"), pytest.param(16, id="quick")])
def test_every_poisoned_number_is_refused_or_harmless(
    moments: dict[int, Moment], measured: Callable[[str], None], share: int
) -> None:
    """Replay what is not refused: where array bounds are checked whole numbers, which may be indices, and a share of
    the others, another one in each moment; elsewhere every seventh field, to end no process. The short form has each
    second whole number."""
    found = Counter[str]()
    cycles = 7 if share == 1 else 4  # in which each sensor of a ring that fires in octets is heard every second time
    for at, whole in enumerate(reversed(moments.values())):
        moment = whole._replace(following=whole.following[:cycles])
        assert not ends_in_error(moment, moment.snapshot)
        replayed = {
            name
            for i, (name, values) in enumerate(numbers_of(moment.snapshot), at)
            if (i % (share if values.dtype.kind == "f" else min(share, 2)) == 0 if BOUNDS_CHECKED else i % 7 == 0)
            if moment.cycle == POISONED_CYCLE or name.startswith(JOB)
        }
        if BOUNDS_CHECKED or moment.cycle == POISONED_CYCLE:
            found += poison_all(moment, replayed.__contains__)
    assert found["refused"] > 100
    assert found["harmless"] > 10 * found["ended"]
    measured(
        f"{found.total():,} poisoned numbers: {found['refused']:,} refused, {found['harmless']} harmless, "
        f"{found['ended']} end in a line of error"
    )


def randomised(moment: Moment, rng: np.random.Generator) -> Snapshot:
    """Return a copy of a state with random numbers, each within its bound, in a random share of its fields."""
    snapshot = {name: array.copy() for name, array in moment.snapshot.items()}
    bounds = moment.bounds()
    sizes = [3, 1e3, 1e12, 1e100]
    fields_share, share, size = rng.choice([0.02, 0.1, 0.5]), rng.choice([0.05, 0.5, 1.0]), rng.choice(sizes)
    for name, values in numbers_of(snapshot):
        if is_scratch(name) or bounds[name].constant or rng.random() > fields_share:
            continue
        low, high = np.clip(bounds[name][:2], -size, size)
        new = rng.uniform(low, high, values.shape) if values.dtype.kind == "f" else rng.integers(
            int(low), int(high), values.shape, endpoint=True
        )  # fmt: skip
        values[...] = np.where(rng.random(values.shape) < share, new, values)
    if "method.outline.pinned" in snapshot:
        snapshot["method.outline.pinned"][...] = np.count_nonzero(snapshot["method.outline.status"] == PINNED)
    return snapshot


@pytest.mark.compiled
@pytest.mark.boundscheck
def test_random_states_within_the_bounds_are_harmless(moments: dict[int, Moment]) -> None:
    found, rng = Counter[bool](), np.random.default_rng(1)
    for moment in itertools.islice(itertools.cycle(moments.values()), 36 if BOUNDS_CHECKED else 12):
        snapshot = randomised(moment, rng)
        with contextlib.suppress(ValueError):
            check_snapshot(snapshot, moment.perception().snapshot(), moment.bounds())
            found[ends_in_error(moment, snapshot)] += 1
    assert found[False] >= 6


@pytest.fixture(scope="module")
def servo_moment() -> Moment:
    """Return a moment of a drive with one sensor on a servo, which has heard something in most directions."""
    settings, taken = load_settings("room", robot="servo1"), list[Moment]()
    assert settings.world is not None

    def on_state(record: CycleRecord, state: State, _start: object) -> None:
        if record.cycle == SERVO_CYCLE:
            is_honest(state.perception, settings)
            taken.append(Moment(record.cycle, settings, carried_state(state), state.perception.snapshot(), []))
        elif taken and len(taken[0].following) < FOLLOWING:
            taken[0].following.append(record)

    within_reach = settings.world.start.model_copy(update={"x_m": 1.2, "y_m": -2.0, "heading_deg": -12.0})
    world = settings.world.model_copy(update={"start": within_reach})
    simulate(settings, world, 2, (SERVO_CYCLE + FOLLOWING + 1) / settings.cycle.rate_hz, on_state=on_state)
    return taken[0]


@pytest.mark.compiled
@pytest.mark.boundscheck
def test_a_poisoned_state_of_a_sensor_on_a_servo_is_refused_or_harmless(servo_moment: Moment) -> None:
    """Its ring remembers what it heard by direction of the room; all else is as of other rings."""
    assert not ends_in_error(servo_moment, servo_moment.snapshot)
    heard = dict(numbers_of(servo_moment.snapshot))["ring_monitor._directions.heard.range_m"]
    assert np.count_nonzero(heard >= 0.0) > 10
    found = poison_all(servo_moment, lambda name: "_directions" in name)
    assert found["refused"] > 100
    assert found["harmless"] > found["ended"]
    rng = np.random.default_rng(4)
    for _ in range(12 if BOUNDS_CHECKED else 4):
        snapshot = randomised(servo_moment, rng)
        with contextlib.suppress(ValueError):
            check_snapshot(snapshot, servo_moment.perception().snapshot(), servo_moment.bounds())
            ends_in_error(servo_moment, snapshot)


@pytest.mark.compiled
@pytest.mark.boundscheck
@pytest.mark.parametrize("number", [2**63 - 1, -(2**63), math.nan, 1e308])
def test_a_poisoned_scratch_is_harmless(moments: dict[int, Moment], number: float) -> None:
    for moment in moments.values():
        assert not ends_in_error(moment, moment.snapshot, number)


@pytest.mark.boundscheck
@pytest.mark.skipif(not BOUNDS_CHECKED, reason="detected only with array bounds checked: make boundscheck")
def test_without_the_check_a_kernel_would_leave_an_array(moments: dict[int, Moment]) -> None:
    """The test above detects what it is to detect."""
    moment = moments[POISONED_CYCLE]
    if "method.outline.start" in moment.snapshot:
        bad = changed(moment, "method._extractor._sensors", ("newest", 10**9))
    else:
        bad = changed(moment, "method.memory.state", ("noise_level", 10**9))
    with pytest.raises(IndexError, match=f"^{OUT_OF_BOUNDS}$"):
        ends_in_error(moment, bad)


@pytest.mark.compiled
def test_contradictions_that_would_never_end_are_refused(moments: dict[int, Moment]) -> None:
    moment = moments[POISONED_CYCLE]
    if "method.outline.pinned" in moment.snapshot:
        bad, match = changed(moment, "method.outline.status", ("", 2)), "segments are pinned"
    else:
        job = (("job.kind", 2), ("job.stage", 5), ("job.lattices", 5))
        bad, match = changed(moment, "method.memory.state", *job), "the stage of lattices is not over"
    with pytest.raises(ValueError, match=match):
        moment.perception().restore(bad)


@pytest.mark.compiled
@pytest.mark.promise("P21")
def test_the_replay_of_a_poisoned_keyframe_ends_in_one_line(edited: Path, tmp_path: Path) -> None:
    entries = entries_of(edited)
    chosen = next(k for k, entry in enumerate(entries) if entry.topic == KEYFRAME)
    frame = decode(Keyframe, entries[chosen].data)
    with open_recording(edited) as recording:
        settings = recording.settings
    fresh = fresh_state(settings).perception.snapshot()
    moment = Moment(frame.cycle, settings, state_fields(frame), perception_snapshot(frame, fresh), [])
    array, field = (
        ("method.outline.start", "") if "method.outline.start" in fresh else ("method.memory.circles", "kind")
    )
    bad = keyframe(frame.cycle, frame.run_s, moment.fields, changed(moment, array, (field, 10**9)))
    rewrite([entries[0], entries[chosen]._replace(data=encode(bad)), *entries[chosen + 1 :]], tmp_path / "x.mcap")
    with open_recording(tmp_path / "x.mcap") as recording:
        refused = [step.refused for step in Replayer(recording) if step.refused is not None]
    assert f"{array}.{field}".rstrip(".") + " is 1000000000, expected 0 to " in refused[0]
    assert "\n" not in refused[0]


def test_a_number_without_a_bound_is_refused() -> None:
    for number in (np.zeros(3, np.int64), np.zeros(3)):
        new = {"method.next": number}
        with pytest.raises(ValueError, match=r"method\.next has no bound"):
            check_snapshot(new, new, {"method": Bound(0, 1)})
