"""The modes of a run on a robot that lies: nothing arms it falsely, and a lie ends in a stop that names it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from config.robot import LinkConfig
from drivers.denning.frames import Ack, Drive, Halt, Hello, Pattern, Release
from drivers.driver import LineState
from drivers.messages import Flags, Twist
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import HELD_UP, Mode, ModeState, advance
from tests.drivers.driver_harness import CONFIG, IDENT, DriverHarness, only

pytestmark = pytest.mark.promise("P22")
base_promise = pytest.mark.promise("P25")

CYCLE_S, ODOMETRY_S = 0.05, 0.01


@dataclass
class FalseRobot:
    """Driver and modes, on a robot whose answers the test chooses."""

    harness: DriverHarness = field(default_factory=DriverHarness)
    mode: ModeState = field(default_factory=ModeState)
    t_us: float = 0.0
    clock: float = 1.0
    """Speed of the robot's clock."""
    flags: Flags = Flags.LATCHED
    obeys: bool = False
    """Whether RELEASE and HALT have an effect."""
    persisting: Flags = Flags.NONE
    """Set beside the latch, and not cleared by RELEASE."""
    momentary: Flags = Flags.NONE
    """Set in the next sample of the odometry only."""
    acknowledges: bool = True
    drives: int = 0

    def __post_init__(self) -> None:
        self.harness.open()

    def cycle(self, request: Request | None = None, gap_s: float = CYCLE_S) -> None:
        """Run a cycle, and the robot until the next one."""
        for _ in range(round(gap_s / ODOMETRY_S)):
            self.harness.now += ODOMETRY_S
            self.t_us += 1e6 * ODOMETRY_S * self.clock
            self.harness.odom(round(self.t_us) % 2**32, flags=int(self.flags | self.momentary))
            self.momentary = Flags.NONE
            self.harness.robot.tick(self.harness.now)
            self._answer()
        inputs = gather_inputs(self.harness.robot, self.harness.now, OperatorInput(request))
        before, self.mode = self.mode, advance(self.mode, inputs, inputs.received.flags, gap_s)
        if self.mode.mode is Mode.DRIVE:
            self.harness.robot.drive(Twist(0.1, 0.0))
        elif self.mode.mode is Mode.SAFE_STOP and self.mode.entered_since(before):
            self.harness.robot.halt()
        elif self.mode.arming_run_s is not None and before.arming_run_s is None:
            self.harness.robot.release()
        self._answer()

    def _answer(self) -> None:
        frames = self.harness.received()
        self.drives += len(only(frames, Drive))
        for frame in frames:
            match frame:
                case Hello():
                    self.harness.send(self.harness.ident)
                case Pattern() | Halt() | Release():
                    if self.acknowledges or isinstance(frame, Pattern):
                        self.harness.send(Ack(0, frame.seq))
                    if self.obeys:
                        self.flags = self.persisting | (Flags.LATCHED if isinstance(frame, Halt) else Flags.NONE)
                case _:
                    pass

    def until(self, mode: Mode, seconds: float, request: Request | None = None) -> None:
        """Run cycles, the first with a request, until a mode is entered."""
        for _ in range(round(seconds / CYCLE_S)):
            self.cycle(request)
            request = None
            if self.mode.mode is mode:
                return
        raise AssertionError(f"{self.mode}, not {mode}")


def driving(case: FalseRobot) -> FalseRobot:
    """Return a case that has been armed, honest so far."""
    case.obeys = True
    case.until(Mode.READY, 1.0)
    case.until(Mode.DRIVE, 2.0, Request.ARM)
    assert case.drives
    return case


def test_a_release_that_is_acknowledged_but_not_done_arms_nothing() -> None:
    case = FalseRobot()
    case.until(Mode.READY, 1.0)
    for _ in range(5):
        before = case.mode
        case.cycle(Request.ARM)
        while not case.mode.entered_since(before):
            case.cycle()
        assert case.mode.mode is Mode.SAFE_STOP
        assert "the base's latch does not clear" in (case.mode.reason or "")
    assert case.drives == 0


def test_acknowledgements_of_all_numbers_arm_nothing() -> None:
    """Sent all the time, for commands that were never given."""
    case = FalseRobot(acknowledges=False)
    case.until(Mode.READY, 1.0)
    for _ in range(40):
        case.harness.send(*(Ack(0, seq) for seq in range(256)))
        case.cycle()
    assert (case.mode.mode, case.drives) == (Mode.READY, 0)


def test_a_drive_by_a_fast_clock_ends_in_a_stop_that_names_it() -> None:
    case = driving(FalseRobot(clock=1.05))
    case.until(Mode.SAFE_STOP, 40.0)
    assert "the robot's clock runs 5.0% too fast" in (case.mode.reason or "")
    drives = case.drives
    for _ in range(100):
        case.cycle()
    assert case.harness.state() is LineState.READY, "it answers again"
    assert case.mode.mode is Mode.SAFE_STOP, "motion never resumes by itself"
    assert "the robot's clock runs 5.0% too fast" in (case.mode.reason or "")
    assert case.drives == drives


def test_a_drive_by_a_clock_that_turns_back_ends_in_a_stop() -> None:
    case = driving(FalseRobot())
    case.clock = -1.0
    case.until(Mode.SAFE_STOP, 0.5)
    assert "restart" in (case.mode.reason or "")
    drives = case.drives
    for _ in range(100):
        case.cycle()
    assert case.drives == drives


@base_promise
def test_no_claimed_deadman_lets_the_program_drive_on_after_a_long_gap() -> None:
    """Not even one that the robot file allows."""
    harness = DriverHarness(CONFIG.model_copy(update={"link": LinkConfig(deadman_max_s=10.0)}))
    harness.ident = replace(IDENT, deadman_ms=10_000)
    case = driving(FalseRobot(harness))
    case.cycle(gap_s=0.4)
    assert case.mode.mode is Mode.DRIVE
    case.cycle(gap_s=0.6)
    assert (case.mode.mode, case.mode.reason) == (Mode.SAFE_STOP, HELD_UP.format(0.6))


@base_promise
@pytest.mark.parametrize(
    ("flag", "reason"), [(Flags.BUMPER, "bumper contact"), (Flags.MOTOR_FAULT, "a motor fault")], ids=str
)
def test_no_robot_is_armed_while_it_reports_what_stops_it(flag: Flags, reason: str) -> None:
    """The base clears its latch all the same, so a DRIVE would be obeyed."""
    case = FalseRobot(obeys=True, persisting=flag)
    case.until(Mode.READY, 1.0)
    case.until(Mode.SAFE_STOP, 2.0, Request.ARM)
    assert reason in (case.mode.reason or "")
    for _ in range(40):
        case.cycle(Request.ARM)
    assert case.drives == 0
    case.persisting = Flags.NONE
    for _ in range(25):
        case.cycle()
    case.until(Mode.DRIVE, 3.0, Request.ARM)


@base_promise
@pytest.mark.parametrize("flag", [Flags.BUMPER, Flags.MOTOR_FAULT, Flags.LATCHED], ids=str)
def test_a_flag_in_one_sample_between_two_cycles_stops_the_drive(flag: Flags) -> None:
    """The first of five; the newest sample has none again."""
    case = driving(FalseRobot())
    case.momentary, drives = flag, case.drives
    case.cycle()
    assert case.mode.mode is Mode.SAFE_STOP
    assert case.drives == drives
