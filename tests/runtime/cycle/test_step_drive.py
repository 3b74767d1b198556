"""The pure step over a drive through the hallway: repeatable to the bit, and within its refinement budget."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

import numpy as np
import pytest

from drivers.driver import LineState, Received
from perception.paper.paper_method import PaperPerception
from perception.pipeline import Perception
from runtime.cycle.modes import Mode, ModeState
from runtime.cycle.step import Command, CycleRecord, Inputs, Order, State, step
from runtime.simulation.closed_loop import simulate
from runtime.timing.refinement_budget import within_quanta_per_cycle
from tests.runtime.scripted_step import NOTHING, PERIOD_S, SETTINGS, ScriptedRobot

# A drive through the hallway, every input of it on record.


@dataclass(frozen=True)
class Drive:
    """Records of a simulated drive and what it left."""

    records: list[CycleRecord]
    state: State


@pytest.fixture(scope="module")
def drive() -> Drive:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 12.0, lambda record, _truth: records.append(record))
    assert len(run.state.perception.objects()) >= 3
    return Drive(records, run.state)


def bits(value: object) -> object:
    """Return `value` in a form whose equality is equality to the bit, arrays and NaN included."""
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, tuple | list):
        return tuple(map(bits, value))
    if dataclasses.is_dataclass(value):
        return tuple((f.name, bits(getattr(value, f.name))) for f in dataclasses.fields(value))
    assert value is None or isinstance(value, int | str | Enum), type(value)
    return value


def paper(state: State) -> PaperPerception:
    assert isinstance(state.perception.method, PaperPerception)
    return state.perception.method


def left_behind(state: State) -> object:
    perception = paper(state)
    arrays = [
        perception.outline.segments, perception.outline.times, perception.outline.status,
        perception.candidates.rows["pose"], perception.candidates.rows["has_rested"], perception.clusters.centres,
    ]  # fmt: skip
    return bits([*arrays, perception.objects(), state.mode, state.leg, state.odometry, state.last_firing_robot_s])


def fresh() -> State:
    return State(Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception))


def played(
    records: list[CycleRecord], may_refine: Callable[[int], bool] = within_quanta_per_cycle
) -> tuple[State, list[CycleRecord]]:
    state, commands = fresh(), list[Command]()
    again = [step(state, record.inputs, SETTINGS, commands.append, may_refine) for record in records]
    assert bits([record.command for record in again]) == bits(commands)
    return state, again


@pytest.mark.compiled
def test_the_same_inputs_give_the_same_records_to_the_bit(drive: Drive) -> None:
    state, again = played(drive.records)
    assert bits(again) == bits(drive.records)
    assert left_behind(state) == left_behind(drive.state)


def test_a_change_of_one_bit_is_detected(drive: Drive) -> None:
    """That the comparison above can fail."""
    k = next(k for k, record in enumerate(drive.records) if record.new_segments)
    record = drive.records[k]
    firing = record.inputs.received.firings[0]
    ranges = np.nextafter(firing.ranges_m, np.inf)
    heard = replace(record.inputs.received, firings=(replace(firing, ranges_m=ranges),))
    changed = [*drive.records]
    changed[k] = replace(record, inputs=replace(record.inputs, received=heard))
    state, again = played(changed)
    assert bits(again) != bits(drive.records)
    assert left_behind(state) != left_behind(drive.state)


@pytest.mark.compiled
def test_one_seed_is_one_drive(drive: Drive) -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    simulate(SETTINGS, SETTINGS.world, 0, 12.0, lambda record, _truth: records.append(record))
    assert bits(records) == bits(drive.records)


def script_of(drive: Drive, quanta: int) -> Iterator[tuple[ScriptedRobot, CycleRecord]]:
    """Replay the drive on a scripted robot, whose log shows the order of events."""
    script = ScriptedRobot(quanta=quanta)
    for record in drive.records:
        script.log.clear()
        yield (
            script,
            step(
                script.state, record.inputs, SETTINGS, lambda c: script.log.append(("command", c)), script.may_refine
            ),
        )


@pytest.mark.parametrize("quanta", [0, 1, 3, 50])
def test_the_command_precedes_refinement_and_each_quantum_needs_permission(drive: Drive, quanta: int) -> None:
    causes = set()
    for script, record in script_of(drive, quanta):
        expected: list[object] = [("command", record.command)]
        done = [entry for entry in script.log if isinstance(entry, tuple) and entry[0] == "refined"]
        for k, entry in enumerate(done):
            expected += [("may?", k), entry]
        if record.refinement == "budget":
            expected.append(("may?", record.quanta))
            assert record.quanta == quanta
            assert script.state.perception.can_refine
        else:
            assert not script.state.perception.can_refine
        assert script.log == expected
        assert record.quanta == len(done) <= quanta
        assert record.iterations == sum(entry[1] for entry in done)
        assert (record.refinement == "nothing") == (script.log == expected[:1])
        causes.add(record.refinement)
    # With 50 quanta a cycle the budget is not always enough at the first sight of a drum, but mostly.
    assert causes >= {0: {"nothing", "budget"}, 1: {"nothing", "budget"}}.get(quanta, {"nothing", "converged"})


def test_refinement_resumes_where_the_last_cycle_ended(drive: Drive) -> None:
    """After the last echo, by one quantum a cycle or all at once: the same resting poses to the bit."""
    echoes = [replace(record, inputs=replace(record.inputs, request=None)) for record in drive.records]
    rested = []
    for quanta in (1, 3, 10_000):
        state, _ = played(echoes, lambda _done: False)
        total, cycles, run_s = 0, 0, echoes[-1].inputs.run_s
        while state.perception.can_refine:
            run_s += PERIOD_S
            cycles += 1
            inputs = Inputs(run_s, LineState.READY, None, NOTHING)
            record = step(state, inputs, SETTINGS, lambda _c: None, partial(operator.gt, quanta))
            assert record.quanta <= quanta
            total += record.iterations
        assert total > 20
        assert (cycles == 1) == (quanta == 10_000)
        perception = paper(state)
        rested.append((total, bits(perception.candidates.rows["pose"]), bits(perception.objects())))
    assert rested[0] == rested[1] == rested[2]
    assert len(rested[0][2]) > 0  # type: ignore[arg-type]


def test_few_quanta_a_cycle_find_what_many_find(drive: Drive) -> None:
    """Echoes keep coming here, so the ways differ; where they lead does not."""
    few, _ = played(drive.records, lambda done: done < 3)
    while few.perception.can_refine:
        few.perception.refine()
    many = {(round(o.x, 1), round(o.y, 1)): o for o in drive.state.perception.objects()}
    for seen in few.perception.objects():
        nearest = min(many.values(), key=lambda o: np.hypot(o.x - seen.x, o.y - seen.y))
        assert np.hypot(nearest.x - seen.x, nearest.y - seen.y) < 0.01
    assert len(few.perception.objects()) == len(many)


def test_a_reboot_clears_the_map_and_the_leg(drive: Drive) -> None:
    state, again = played(drive.records)
    last = again[-1]
    assert last.segments > 20
    assert state.leg is not None
    inputs = Inputs(last.inputs.run_s + PERIOD_S, LineState.READY, None, Received((), None, rebooted=True))
    commands: list[Command] = []
    record = step(state, inputs, SETTINGS, commands.append, within_quanta_per_cycle)
    assert commands == [Order.HALT]
    assert (record.segments, record.clusters, record.refinement) == (0, 0, "nothing")
    assert state.perception.objects() == ()
    assert bits((state.odometry, state.leg, state.last_firing_robot_s)) == bits((None, None, 0.0))
    assert (state.mode.mode, state.cycle) == (Mode.SAFE_STOP, last.cycle + 1)
    assert "restarted" in str(state.mode.reason)


def test_after_a_reboot_perception_is_as_at_the_start(drive: Drive) -> None:
    used, _ = played(drive.records)
    step(
        used,
        Inputs(1e3, LineState.READY, None, Received((), None, rebooted=True)),
        SETTINGS,
        lambda _c: None,
        within_quanta_per_cycle,
    )
    new = fresh()
    for record in drive.records:
        for state in (used, new):
            state.mode = ModeState(Mode.READY)
        one, other = (step(s, record.inputs, SETTINGS, lambda _c: None, within_quanta_per_cycle) for s in (used, new))
        assert bits(one.new_segments) == bits(other.new_segments)
    assert numberless(used) == numberless(new)
    assert {o.number for o in used.perception.objects()}.isdisjoint(
        {o.number for o in drive.state.perception.objects()}
    )


def numberless(state: State) -> object:
    """Return the objects apart from their numbers, of which none is used twice."""
    return bits([replace(seen, number=None) for seen in state.perception.objects()])


def test_without_a_budget_the_record_names_the_budget_exactly_where_work_was_left(drive: Drive) -> None:
    state = fresh()
    causes = set()
    for record in drive.records:
        got = step(state, record.inputs, SETTINGS, lambda _c: None, lambda _done: False)
        assert (got.quanta, got.iterations) == (0, 0)
        assert got.refinement == ("budget" if state.perception.can_refine else "nothing")
        causes.add(got.refinement)
    assert causes == {"budget", "nothing"}
