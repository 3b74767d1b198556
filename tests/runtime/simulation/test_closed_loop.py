"""Tests of the closed loop in virtual time: when it ends, and what operator, reload and observers see of it."""

from __future__ import annotations

import pytest

from config.load import load_settings, load_world
from config.settings import Settings
from drivers.emulator.robot_device import GroundTruth
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import SETTLING_S, SimulationOptions, simulate

SETTINGS = load_settings(
    "hallway", ["perception.method=paper", "behaviors.move_ahead.distance_m=0.3", "behaviors.move_ahead.at_end=stop"]
)
WORLD = load_world("hallway")


def test_a_run_ends_when_the_last_echoes_after_its_leg_have_counted() -> None:
    records: list[CycleRecord] = []
    truths: list[GroundTruth] = []

    def on_cycle(record: CycleRecord, truth: GroundTruth) -> None:
        records.append(record)
        truths.append(truth)

    run = simulate(SETTINGS, WORLD, 0, 60.0, on_cycle)
    assert run.state.leg is not None
    assert run.state.leg.done
    assert run.cycle_stats.cycles == len(records)
    assert [record.inputs.run_s for record in records[:2]] == [0.05, 0.1]
    assert records[-1].inputs.run_s == run.virtual_s < 10.0
    # The robot brakes from 0.3 m/s at 0.5 m/s² once the leg is done: for 0.6 s and 0.09 m, and a cycle before that.
    settled = [truth for truth in truths if truth.emulated_s > run.virtual_s - SETTLING_S + 0.7]
    assert settled
    assert all(truth.twist.v == 0.0 for truth in settled)
    assert 0.3 <= run.truth.pose.x - run.start.x <= 0.3 + 0.09 + 0.3 * 0.1
    assert (run.counts.bad, run.counts.lost) == (0, 0)


def test_the_same_seed_is_the_same_run() -> None:
    runs = [
        simulate(SETTINGS, WORLD, seed, 3.0, options=SimulationOptions(clock_start_us=2**32 - 1_000_000))
        for seed in (1, 1)
    ]
    assert runs[0].truth == runs[1].truth
    assert runs[0].state.odometry == runs[1].state.odometry
    assert runs[0].state.mode.mode is Mode.DRIVE, "the wrap of the robot's clock is no restart"


def test_only_an_operator_arms_where_there_is_one_and_the_run_has_its_full_length() -> None:
    modes: list[Mode] = []

    def operator(cycle: int, state: State) -> OperatorInput:
        modes.append(state.mode.mode)
        return OperatorInput({40: Request.ARM, 60: Request.HALT}.get(cycle))

    run = simulate(SETTINGS, WORLD, 0, 4.0, operator=operator)
    assert run.virtual_s == 4.0
    assert set(modes[:40]) <= {Mode.CONNECTING, Mode.READY}
    assert modes[58] is Mode.DRIVE
    assert set(modes[61:]) == {Mode.SAFE_STOP}


def test_reloaded_settings_are_in_force_from_their_cycle_on() -> None:
    slower = load_settings("hallway", ["perception.method=paper", "behaviors.arbiter.base_velocity_m_s=0.1"])
    way: list[tuple[str, float]] = []

    def reload(cycle: int) -> Settings | None:
        return slower if cycle == 60 else None

    def on_bytes(direction: str, run_s: float, _data: bytes) -> None:
        way.append((direction, run_s))

    run = simulate(
        load_settings("hallway", ["perception.method=paper"]),
        WORLD,
        0,
        5.0,
        options=SimulationOptions(reload=reload, on_bytes=on_bytes),
    )
    assert run.truth.twist.v == pytest.approx(0.1, abs=0.02)
    assert {direction for direction, _ in way} == {"in", "out"}
