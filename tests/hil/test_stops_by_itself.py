"""P1: whatever becomes of the main process or its line, at whatever moment, the base stops by itself and stays so.

The emulator's truth is judged on the emulator's clock: however busy the machine is, the robot's half second is half a
second. The long form has four robots at a time, one for each kind of fault.

No program can rule out that it is stopped between its last look at the clock and the write of a DRIVE.
That one leaves when it goes on, with a HALT right behind it; a machine that stands still just then lets the wheels
turn until the HALT comes. The short form therefore looks at the wheels before the process goes on, and again from the
HALT on; virtual time shows that the HALT follows (tests/runtime/cycle/test_halt_bounded.py).
"""

from __future__ import annotations

import contextlib
import random
import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from drivers.messages import Flags
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.planted import HELD, LONG_S, planted
from tests.hil.running import DEADMAN_S, PATIENT, Running, emulated, wait_for
from tests.hil.truth import DRIVING_M_S, Truth

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P1")]

STOPPED_WITHIN_S = DEADMAN_S + 0.3
STRAIGHT_ON = ("--set", "behaviors.move_ahead.distance_m=10000.0")
PATIENT_STARTS = 5
PHASE_S = 0.2
"""Four cycles, or ten periods of the odometry: a fault comes anywhere in them."""
WORLD = """
[[drum]]
x_m = 2.0
y_m = 3.0
radius_m = 0.3
"""
"""A drum next to the path, and nothing on it."""


class Drive:
    """A robot under way, and the operator who arms it again after each fault."""

    def __init__(self, run: Running, truth: Truth) -> None:
        self.run = run
        self.truth = truth
        self.worst_s = 0.0

    def stops(self) -> int:
        return self.run.modes().count("SAFE_STOP")

    def get_under_way(self, at_least_m_s: float = DRIVING_M_S) -> None:
        """Arm until it drives; a busy machine may have stopped it once more by itself."""
        end_s, armed_s = time.monotonic() + TIMEOUT_S, 0.0
        while not ((rows := self.truth.read()) and rows[-1].v > at_least_m_s):
            host_s = time.monotonic()
            assert host_s < end_s, (self.run.modes(), self.run.err)
            if host_s - armed_s > 2.0 and self.run.modes()[-1:] in (["SAFE_STOP"], ["READY"]):
                armed_s = host_s
                self.run.signal(signal.SIGUSR1)
            time.sleep(0.01)

    def match_objects(self, since_t_s: float) -> None:
        """Assert that the wheels have stood still from the bound on, up to now."""
        self.truth.wait(lambda row: row.t_s > since_t_s + STOPPED_WITHIN_S + 0.1, "the robot's time")
        seen = self.truth.since(since_t_s)
        moving = [row.t_s - since_t_s for row in seen if not row.still]
        assert not moving or moving[-1] <= STOPPED_WITHIN_S, f"still moving {moving[-1]:.3f} s after it"
        self.worst_s = max(self.worst_s, moving[-1] if moving else 0.0)

    def suffer(self, fault: Callable[[], object], over: Callable[[], object], rng: random.Random) -> None:
        """Have a fault happen at a random moment of a drive, and drive on after it only once armed."""
        while True:
            self.get_under_way()
            before = self.stops()
            time.sleep(rng.uniform(0.0, PHASE_S))
            fault()
            at = self.truth.at(time.monotonic())
            self.match_objects(at.t_s)
            over()
            wait_for(lambda: self.stops() > before, f"a SAFE_STOP after {self.run.modes()}")  # noqa: B023
            # As long again (what is called here is called within the turn): it was not armed.
            until_s = self.truth.read()[-1].t_s + STOPPED_WITHIN_S / 2.0
            self.truth.wait(lambda row: row.t_s > until_s, "a while in SAFE_STOP")  # noqa: B023
            self.match_objects(at.t_s)
            if at.driving:
                return


def stopped(folder: Path, count: int) -> float:
    """SIGSTOP, and SIGCONT once the base stands."""
    rng = random.Random(1)
    with (
        emulated(folder, "--world", world(folder)) as robot,
        planted(folder, "run", "", "run", "--port", robot.port, *STRAIGHT_ON) as run,
    ):
        drive = Drive(run, Truth(robot.trace))
        for _ in range(count):
            drive.suffer(lambda: run.signal(signal.SIGSTOP), lambda: run.signal(signal.SIGCONT), rng)
        return end(drive)


def busy(folder: Path, count: int, longest: int) -> float:
    """A callback that holds the loop for ten seconds, or for two deadmen."""
    rng = random.Random(2)
    with (
        emulated(folder, "--world", world(folder)) as robot,
        planted(folder, "run", "busy", "run", "--port", robot.port, *STRAIGHT_ON) as run,
    ):
        drive = Drive(run, Truth(robot.trace))
        for k in range(count):
            number = signal.SIGURG if k < longest else signal.SIGWINCH
            begin_host_s = time.monotonic()
            drive.suffer(lambda n=number: run.signal(n), lambda: None, rng)  # type: ignore[misc]
            assert k >= longest or time.monotonic() - begin_host_s > LONG_S
        assert "held up for" in (folder / "run.jsonl").read_text("utf-8")
        return end(drive)


def unplugged(folder: Path, count: int) -> float:
    """The line pulled out for a moment, or for long, by a fault script."""
    rng = random.Random(3)
    times_s = [4.0 + 3.0 * k + rng.uniform(0.0, PHASE_S) for k in range(4 * count + 10)]
    script = folder / "faults.toml"
    fault = '[[fault]]\nkind = "unplug"\nat_s = {:.4f}\nduration_s = {:.4f}\n'
    script.write_text("".join(fault.format(at_s, rng.choice((0.03, 0.3, 1.0))) for at_s in times_s), "utf-8")
    with (
        emulated(folder, "--world", world(folder), "--faults", str(script)) as robot,
        contextlib.ExitStack() as runs,
    ):
        drive, hits = Drive(started_while_plugged_in(runs, folder, robot.port), Truth(robot.trace)), 0
        for at_s in times_s:
            if drive.truth.read()[-1].t_s > at_s - 0.3:
                continue
            drive.get_under_way()
            before = drive.stops()
            drive.truth.wait(lambda row, at_s=at_s: row.t_s > at_s, "the moment of the fault")  # type: ignore[misc]
            if not drive.truth.at_robot(at_s).driving:
                continue
            drive.match_objects(at_s)
            wait_for(lambda: drive.stops() > before, "a SAFE_STOP")  # noqa: B023
            drive.match_objects(at_s)
            hits += 1
            if hits == count:
                return end(drive)
    raise AssertionError(f"only {hits} of {len(times_s)} faults found it driving")


def started_while_plugged_in(runs: contextlib.ExitStack, folder: Path, port: str) -> Running:
    """Start the run; one that finds the line just pulled out says so and ends, as it must, and is started again."""
    for k in range(PATIENT_STARTS):
        run = runs.enter_context(planted(folder, f"run{k}", "", "run", "--port", port, *STRAIGHT_ON))
        wait_for(lambda run=run: bool(run.modes()) or run.process.poll() is not None, "a start")  # type: ignore[misc]
        if run.modes():
            return run
        assert len(run.error_lines) == 1, run.err
    raise AssertionError(f"pulled out just then {PATIENT_STARTS} times: {run.err}")


def killed(folder: Path, count: int) -> float:
    """SIGKILL; the restarted process stands until it is armed."""
    rng = random.Random(4)
    worst_s = 0.0
    with emulated(folder, "--world", world(folder)) as robot:
        truth = Truth(robot.trace)
        since_t_s = 0.0
        for k in range(count):
            with planted(folder, f"run{k}", "", "run", "--port", robot.port, *STRAIGHT_ON) as run:
                run.comes_to("READY")
                drive = Drive(run, truth)
                up_t_s = truth.read()[-1].t_s
                truth.wait(lambda row, t_s=up_t_s: row.t_s > t_s + 0.5, "a while in READY")  # type: ignore[misc]
                if k:
                    drive.match_objects(since_t_s)
                drive.get_under_way()
                time.sleep(rng.uniform(0.0, PHASE_S))
                run.signal(signal.SIGKILL)
                run.process.wait()
                since_t_s = truth.at(time.monotonic()).t_s
                drive.match_objects(since_t_s)
                worst_s = max(worst_s, drive.worst_s)
    return worst_s


def world(folder: Path) -> str:
    path = folder / "world.toml"
    path.write_text(WORLD, "utf-8")
    return str(path)


def end(drive: Drive) -> float:
    """End the run in good order; return how long the wheels turned after a fault, at worst."""
    drive.run.signal(signal.SIGTERM)
    assert drive.run.end() == 0
    assert drive.run.error_lines == []
    return drive.worst_s


def all_at_once(folder: Path, **counts: tuple[int, ...]) -> tuple[int, float]:
    """Have everything happen so many times; return how many times in all and the longest that wheels turned."""
    what: dict[str, Callable[..., float]] = {
        "stopped": stopped, "busy": busy, "unplugged": unplugged, "killed": killed
    }  # fmt: skip
    with ThreadPoolExecutor(len(counts)) as together:
        under_way = []
        for name, how_many in counts.items():
            (folder / name).mkdir()
            under_way.append(together.submit(what[name], folder / name, *how_many))
        worst_s = max(one.result() for one in under_way)
    return sum(how_many[0] for how_many in counts.values()), worst_s


def stands_after(drive: Drive, fault_host_s: float) -> float:
    """Wait until the wheels stand; return how long they turned after a fault, by the robot's clock, s."""
    drive.truth.wait(lambda row: row.host_s > fault_host_s, "a row after the fault")
    since_t_s = next(row.t_s for row in drive.truth.rows if row.host_s > fault_host_s)
    before_s, drive.worst_s = drive.worst_s, 0.0
    drive.match_objects(since_t_s)
    turned_s, drive.worst_s = drive.worst_s, max(before_s, drive.worst_s)
    return turned_s


def stands_until_armed(drive: Drive, stops_before: int) -> None:
    """Wait until the program has halted the base; then the wheels stand until it is armed again."""
    wait_for(lambda: drive.stops() > stops_before, f"a SAFE_STOP after {drive.run.modes()}")
    halted = drive.truth.wait(lambda row: row.still and Flags.LATCHED in row.flags, "a halted base")
    drive.truth.wait(lambda row: row.t_s > halted.t_s + DEADMAN_S, "a while in SAFE_STOP")
    after = drive.truth.since(halted.t_s)
    assert all(row.still and Flags.LATCHED in row.flags for row in after)


def test_one_fault_of_each_kind(tmp_path: Path, measured: Callable[[str], None]) -> None:
    with (
        emulated(tmp_path, "--world", world(tmp_path)) as robot,
        planted(tmp_path, "run", "busy", "run", "--port", robot.port, *STRAIGHT_ON, *PATIENT) as run,
    ):
        run.comes_to("READY")
        drive = Drive(run, Truth(robot.trace))
        drive.truth.wait(lambda row: row.t_s > 0.0, "the robot's time")
        assert all(row.still for row in drive.truth.read()), "nothing moves before it is armed"

        drive.get_under_way()
        before = drive.stops()
        stopped_s = stands_after(drive, run.signal(signal.SIGSTOP).after_s)
        run.signal(signal.SIGCONT)
        stands_until_armed(drive, before)

        drive.get_under_way()
        before = drive.stops()
        run.signal(signal.SIGWINCH)
        wait_for(lambda: run.out.startswith(HELD) and run.out.endswith("\n"), "a loop that is held")
        busy_s = stands_after(drive, float(run.out.removeprefix(HELD)))
        stands_until_armed(drive, before)

        drive.get_under_way()
        run.signal(signal.SIGKILL)
        run.process.wait()
        killed_s = stands_after(drive, time.monotonic())
    measured(
        f"by the robot's clock, wheels still after SIGSTOP ≤ {stopped_s:.3f} s, in a busy loop ≤ {busy_s:.3f} s, "
        f"after SIGKILL ≤ {killed_s:.3f} s"
    )


@pytest.mark.soak
@stalls_excused
def test_at_two_hundred_moments(tmp_path: Path, measured: Callable[[str], None]) -> None:
    count, worst_s = all_at_once(tmp_path, stopped=(70,), busy=(30, 30), unplugged=(70,), killed=(30,))
    measured(f"{count} faults of four kinds at random phases: wheels still ≤ {worst_s:.3f} s later, until re-armed")
