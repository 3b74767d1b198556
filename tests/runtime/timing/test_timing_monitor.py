"""Tests of the timing monitor in virtual time: every delay is attributed to its cause, and none is invented."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from config.load import load_settings
from drivers.driver import LineState, Received
from drivers.messages import Firing, Flags, Odometry, Pose, Twist
from perception.pipeline import Perception
from runtime.cycle.inputs import Request
from runtime.cycle.step import Command, Inputs, Order, State, step
from runtime.timing.clock_sampler import QUICK_S, ClockSample
from runtime.timing.cycle_stats import CAUSES_MAX, OTHERS, CycleStats
from runtime.timing.pacing import CycleStart, Pacer
from runtime.timing.phases import Phase
from runtime.timing.stall_sampler import StackSample
from runtime.timing.timing_monitor import OUTSIDE, SPANS_MAX, THREAD, UNTIMED, TimingMonitor

US = 1e-6
AXES = np.radians(15.0 * np.arange(24))
PERIOD_US, LATE_US = 50_000, 5_000
PHASE_US, RECEIVE_US = 200, 100
BEGIN_US = 7_000_000


class Machine:
    """Clocks that only simulated work moves; in whole microseconds, so that statistics can be exact."""

    def __init__(self) -> None:
        self.host_us, self.thread_us, self.others_us, self.waits = BEGIN_US, 0, 0, 0

    def read(self) -> ClockSample:
        host_s = self.host_us * US
        return ClockSample(host_s, host_s, self.thread_us * US, self.others_us * US, self.waits)

    def read_after(self, begin: ClockSample) -> ClockSample:
        """As `ClockSampler.read_after`."""
        host_s = self.host_us * US
        took_s = host_s - begin.host_s
        if took_s >= QUICK_S:
            return self.read()
        return begin._replace(run_s=host_s, host_s=host_s, thread_s=begin.thread_s + took_s)

    def work(self, us: int) -> None:
        self.host_us, self.thread_us = self.host_us + us, self.thread_us + us

    def be_suspended(self, us: int) -> None:
        self.host_us += us

    def block(self, us: int) -> None:
        self.host_us, self.waits = self.host_us + us, self.waits + 1

    def wait_for_thread(self, us: int) -> None:
        self.host_us, self.others_us, self.waits = self.host_us + us, self.others_us + us, self.waits + 1


@dataclass(frozen=True)
class Delay:
    """What goes wrong in one slot."""

    place: str
    us: int
    how: Callable[[Machine, int], None]
    cause: str


def delays(count: int, seed: int) -> list[Delay]:
    chance = random.Random(seed)
    made = []
    for _ in range(count):
        place = chance.choice([*(phase.value for phase in Phase), "link receive", "untimed", "asleep", "nowhere"])
        how, cause = chance.choice(
            [(Machine.work, place), (Machine.block, place), (Machine.be_suspended, OUTSIDE),
             (Machine.wait_for_thread, THREAD)]
        )  # fmt: skip
        if place == "untimed":
            how, cause = Machine.work, UNTIMED
        elif place == "asleep":
            how, cause = chance.choice([(Machine.block, OUTSIDE), (Machine.wait_for_thread, THREAD)])
        us = 0 if place == "nowhere" else round(chance.choice([2e3, 60e3, 400e3]) * chance.random()) + 300
        made.append(Delay(place, us, how, cause))
    return made


class Run:
    """A loop on that machine with one delay a slot, and an independent account in whole microseconds."""

    def __init__(self) -> None:
        self.machine = Machine()
        self.pacer = Pacer(BEGIN_US * US, PERIOD_US * US)
        self.stats = CycleStats(LATE_US * US)
        self.timing_monitor = TimingMonitor(
            self.stats, self.machine.read, callbacks=("link receive",), read_after=self.machine.read_after
        )
        self.receive = self.timing_monitor.timed("link receive", self._at_receive)
        self._delay = Delay("nowhere", 0, Machine.work, "")
        # The account.
        self.due_us = self.deadline_us = BEGIN_US
        self.late = self.missed = self.overruns = 0
        self.faults: Counter[str] = Counter()
        self.phase_us = dict.fromkeys((phase.value for phase in Phase), 0)

    def _meet(self, place: str) -> None:
        if self._delay.place == place:
            self._delay.how(self.machine, self._delay.us)

    def _at_receive(self) -> None:
        self.machine.work(RECEIVE_US)
        self._meet("link receive")

    def slot(self, delay: Delay) -> None:
        """Run a cycle and what comes after it, up to the next one's beginning."""
        self._delay, machine, began_us = delay, self.machine, self.machine.host_us
        for phase in Phase:
            machine.work(PHASE_US)
            self._meet(phase.value)
            self.phase_us[phase.value] += PHASE_US + (delay.us if delay.place == phase.value else 0)
            self.timing_monitor.mark(phase)
        self.timing_monitor.end()
        ended_us = machine.host_us
        self.pacer.advance(ended_us * US)
        self.receive()
        self._meet("untimed")
        busy_us = machine.host_us - began_us - (delay.us if delay.place == "untimed" else 0)
        machine.block(max(0, round(self.pacer.deadline_s / US) - machine.host_us))
        self._meet("asleep")
        self._account(ended_us, busy_us)
        self.begin()

    def _account(self, ended_us: int, busy_us: int) -> None:
        now_us = self.machine.host_us
        while self.deadline_us <= ended_us:
            self.deadline_us += PERIOD_US
        missed = 0
        while self.due_us + PERIOD_US // 2 <= now_us:
            self.due_us += PERIOD_US
            missed += 1
        self.missed += missed
        overrun = missed > 0 or busy_us >= PERIOD_US
        late = now_us - self.deadline_us > LATE_US
        self.late += late
        self.overruns += overrun
        if late or overrun:
            self.faults[self._delay.cause] += 1

    def begin(self) -> CycleStart:
        now, period_s = self.machine.read(), self.pacer.period_s
        start = self.pacer.begin(now.run_s)
        self.timing_monitor.begin(now, start, period_s, is_following=False)
        if self.missed or self.machine.host_us > BEGIN_US:
            self.due_us += PERIOD_US
            self.deadline_us = self.due_us
        else:
            self.due_us = self.deadline_us = BEGIN_US + PERIOD_US
        return start


@pytest.mark.compiled
def test_ten_thousand_delays_are_attributed_to_their_causes_and_none_is_invented() -> None:
    run = Run()
    run.begin()
    injected = delays(10_000, 11)
    for number, delay in enumerate(injected):
        run.slot(delay)
        assert run.stats.causes == dict(run.faults), (number, delay)
        assert (run.pacer.missed, run.timing_monitor.overruns) == (run.missed, run.overruns), (number, delay)
    timing = run.timing_monitor.summary()
    assert (run.stats.cycles, run.stats.missed, timing["missed"]) == (10_000, run.missed, run.missed)
    # The lateness of the last cycle, which has not ended, is not counted yet.
    assert run.late - 1 <= run.stats.late <= run.late
    assert sum(run.faults.values()) > 2_000
    assert set(run.faults) == {*(phase.value for phase in Phase), "link receive", UNTIMED, OUTSIDE, THREAD}
    for phase in Phase:
        total_us = run.timing_monitor._phases[phase].total_s / US
        assert total_us == pytest.approx(run.phase_us[phase.value], abs=1.0)
        worst = max((d.us for d in injected if d.place == phase.value), default=0)
        assert timing["phases"][phase.value]["max"] == pytest.approx(PHASE_US + worst, abs=0.2)
    assert timing["callbacks"]["link receive"]["p50"] == pytest.approx(RECEIVE_US, abs=0.2)


def test_without_delays_there_are_no_causes() -> None:
    run = Run()
    run.begin()
    for _ in range(2_000):
        run.slot(Delay("nowhere", 0, Machine.work, ""))
    timing = run.timing_monitor.summary()
    assert (timing["faults"], timing["overruns"], timing["missed"], run.stats.late) == ({}, 0, 0, 0)
    assert all(spread["max"] == pytest.approx(PHASE_US, abs=0.2) for spread in timing["phases"].values())
    assert timing["late"]["max"] == pytest.approx(0.0, abs=0.2)


def test_overruns_in_a_row_are_counted_until_a_cycle_keeps_its_time() -> None:
    run = Run()
    run.begin()
    rows = []
    for us in (60_000, 60_000, 90_000, 10_000, 60_000):
        run.slot(Delay("refine", us, Machine.work, "refine"))
        rows.append(run.timing_monitor.overruns_in_a_row)
    assert rows == [1, 2, 3, 0, 1]
    for cause in ("perceive", "perceive"):
        assert run.timing_monitor.main_cause == "refine"
        run.slot(Delay(cause, 60_000, Machine.work, cause))
    assert run.timing_monitor.main_cause == "perceive", "the most frequent cause"
    run.slot(Delay("nowhere", 0, Machine.work, ""))
    assert (run.timing_monitor.overruns_in_a_row, run.timing_monitor.main_cause) == (0, "")


def test_a_stack_sample_names_the_cause() -> None:
    run, samples = Run(), [StackSample("Recorder.flush", "fsync"), StackSample("RobotProcess.run", "View.on_cycle")]
    run.timing_monitor = TimingMonitor(run.stats, run.machine.read, lambda: samples[0], ("link receive",))
    run.receive = run.timing_monitor.timed("link receive", run._at_receive)
    run.begin()
    run.slot(Delay("untimed", 70_000, Machine.work, ""))
    run.slot(Delay("untimed", 70_000, Machine.block, ""))
    assert run.stats.causes == {"callback Recorder.flush": 2}
    samples.pop(0)
    run.slot(Delay("observers", 70_000, Machine.work, ""))
    assert run.stats.causes["observers (in View.on_cycle)"] == 1


def test_the_number_of_causes_is_bounded() -> None:
    stats = CycleStats(LATE_US * US)
    for number in range(1000):
        stats.add_cause(f"callback {number}")
    assert len(stats.causes) == CAUSES_MAX + 1
    assert stats.causes[OTHERS] == 1000 - CAUSES_MAX


# The real step.

SETTINGS = load_settings("hallway", ["perception.method=paper"])


class SlowPerception(Perception):
    """Perception whose parts take their time."""

    machine: Machine
    observe_us = refine_us = 0

    def observe(self, firing: Firing) -> int:
        self.machine.work(self.observe_us)
        return super().observe(firing)

    @property
    def can_refine(self) -> bool:
        return self.refine_us > 0

    def refine(self) -> int:
        self.machine.work(self.refine_us)
        return 1


def test_the_phases_of_the_newest_cycle_stay_in_a_long_pause() -> None:
    machine = Machine()
    monitor = TimingMonitor(CycleStats(LATE_US * US), machine.read, callbacks=("receive",))
    monitor.begin(machine.read(), CycleStart(BEGIN_US * US, 0.0, 0, None), 1e3, is_following=False)
    machine.work(PHASE_US)
    monitor.mark(Phase.PERCEIVE)
    monitor.end()
    receive = monitor.timed("receive", lambda: machine.work(RECEIVE_US))
    for _ in range(2 * SPANS_MAX):
        receive()
    assert {name: round(s / US) for name, s in monitor.last_cycle().phases_s.items()} == {"perceive": PHASE_US}


@pytest.mark.parametrize("observe_us", [0, 7_000])
@pytest.mark.parametrize("command_us", [0, 9_000])
@pytest.mark.parametrize("refine_us", [0, 400_000])
def test_the_step_marks_its_phases_and_no_overrun_delays_a_stop(
    observe_us: int, command_us: int, refine_us: int
) -> None:
    machine = Machine()
    perception = SlowPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    perception.machine, perception.observe_us = machine, observe_us
    stats = CycleStats(LATE_US * US)
    monitor = TimingMonitor(stats, machine.read)
    state, commands = State(perception), list[tuple[Command, int]]()

    def carry_out(command: Command) -> None:
        commands.append((command, machine.host_us))
        machine.work(command_us)

    for cycle in range(30):
        here = Pose(0.01 * cycle, 0.0, 0.0)  # wheels that stand in DRIVE would end it
        perception.refine_us = refine_us if cycle > 20 else 0
        began_us = machine.host_us
        t_s = 1.0 + 0.05 * cycle
        # In a round room of 3 m; the same readings would be those of a frozen ring.
        ranges = np.sqrt(9.0 - (here.x * np.sin(AXES)) ** 2) - here.x * np.cos(AXES)
        heard = Received(
            (Firing(t_s, here, 0.0, ranges),),
            Odometry(t_s, here, 0.0, Twist(0.0, 0.0), Flags.NONE, 0),
            rebooted=False,
        )
        request = {1: Request.ARM, 25: Request.HALT}.get(cycle)
        monitor.begin(machine.read(), CycleStart(began_us * US, 0.0, 0, None), 1e3, is_following=False)
        inputs = Inputs(t_s, LineState.READY, None, heard, request)
        record = step(state, inputs, SETTINGS, carry_out, lambda done: done < 1, monitor.mark)
        monitor.end()
        assert commands[-1][1] - began_us == observe_us, "only `observe` precedes the command"
        took = {span.name: round(span.took_s / US) for span in monitor._spans}
        assert took == {
            "perceive": observe_us, "decide": 0, "command": command_us, "refine": perception.refine_us
        }  # fmt: skip
        assert record.quanta == (perception.refine_us > 0)
        assert record.refinement == ("budget" if perception.refine_us else "nothing")
    assert commands[25][0] is Order.HALT
    assert isinstance(commands[24][0], Twist), state.mode
