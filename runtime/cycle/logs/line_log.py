"""What the log says about the line while the robot runs: its loss and return, corrupt frames, refused arming."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from drivers.driver import LineState, RobotDriver
from drivers.messages import Identity, LinkCounts
from drivers.token_bucket import LineLimit
from runtime.cycle.inputs import Request
from runtime.cycle.line_messages import LineMessages
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord

if TYPE_CHECKING:
    from collections.abc import Iterator

    from structlog.typing import FilteringBoundLogger

LINES_PER_S: Final = 1.0 / 60.0
LINES_BURST: Final = 3.0
"""Losses and returns that are logged one by one: a cable that is moved causes some; one that is loose, thousands."""
NOISE_S: Final = 5.0
"""Time over which corrupt frames are counted, s."""
NOISE_MIN: Final = 5
NOISE_SHARE: Final = 0.05
"""A line with so many corrupt frames, and such a share of all, is noisy until none is corrupt: a good one has none
but where it begins. A fifth of a Pioneer's ten frames a second are ten in this time on average, and five or more in
97 of 100 such times."""
FRAMES_MAX_PER_S: Final = 2000.0
"""More valid frames than any robot sends, 1/s: a full line of 115,200 baud carries 1,280 of the shortest."""
EVENTS: Final = ("line lost", "line down", "line back", "line flooded")
NO_REASON: Final = "the robot is not ready"

CORRUPT: Final = (
    "{:.0%} of the frames are corrupt, {:.0f} a second; noise on the line: check its cable and shield, and that "
    "nothing else sends on it"
)
TOO_MANY: Final = (
    "the line brings {:.0f} valid frames a second, many times what a robot sends; its firmware is faulty, or another "
    "device sends on the line: restart the robot, and check what else is connected"
)
ANOTHER: Final = (
    "another robot answers on this port: {}; likely it took the port's name: check that it is the one of this run "
    "before it is armed"
)


class LineLog:
    """Logs what is new about the line, each fact once and at a bounded rate.

    `messages` words what is at the other end of the line.
    """

    def __init__(self, log: FilteringBoundLogger, messages: LineMessages) -> None:
        self._log = log
        self._messages = messages
        self._limits = {name: LineLimit(LINES_PER_S, LINES_BURST) for name in EVENTS}
        self._refusals = LineLimit(1.0, LINES_BURST)
        self._is_ready, self._is_flooded = True, False
        self._problem: str | None = None
        self._robot: Identity | None = None
        self._counts = LinkCounts()
        self._counted_s: float | None = None
        self._is_noisy = self._is_crowded = False

    def lost(self, reason: str, run_s: float) -> None:
        """Log that the line was closed."""
        self._say("line lost", run_s, reason=self._messages.problem(LineState.CLOSED, reason))

    def observe(self, record: CycleRecord, driver: RobotDriver, flood: str | None = None) -> None:
        """Log what a cycle brought; `flood` says that bytes are dropped."""
        inputs, run_s = record.inputs, record.inputs.run_s
        if inputs.line is LineState.READY:
            if not self._is_ready:
                self._returned(driver, run_s)
            elif self._robot is None and driver.identity is not None:
                self._robot = driver.identity
        elif inputs.line is not LineState.CLOSED and inputs.line_problem not in (None, self._problem):
            self._problem = inputs.line_problem
            self._say("line down", run_s, reason=inputs.line_problem)
        self._is_ready = inputs.line is LineState.READY
        if flood is not None and not self._is_flooded:
            self._say("line flooded", run_s, reason=flood)
        self._is_flooded = flood is not None
        if inputs.request is Request.ARM:
            self._judge_arming(record)
        if self._counted_s is None or not 0.0 <= run_s - self._counted_s < NOISE_S:
            self._count(driver.counts, run_s)

    def _returned(self, driver: RobotDriver, run_s: float) -> None:
        """Log that the line is back, and whether another robot answers on it."""
        self._problem = None
        robot = driver.identity
        if robot is not None and self._robot is not None and (differs := differences(robot, self._robot)):
            self._log.warning(ANOTHER.format(differs))
        self._robot = robot or self._robot
        self._say("line back", run_s, robot=None if robot is None else robot.name)

    def _judge_arming(self, record: CycleRecord) -> None:
        """Log why the robot is not being armed although it was requested."""
        mode = record.mode
        if mode.mode is Mode.DRIVE or mode.arming_run_s is not None:
            return
        left_out = self._refusals.take(record.inputs.run_s)
        if left_out is not None:
            reason = mode.reason or record.inputs.line_problem or NO_REASON
            self._log.warning("arming refused", mode=mode.mode.value, reason=reason, **_more(left_out))

    def _count(self, counts: LinkCounts, run_s: float) -> None:
        """Log that the line has become noisy, or brings too many frames, since the last count."""
        before, self._counts = self._counts, counts
        since_s, self._counted_s = self._counted_s, run_s
        if since_s is None or run_s <= since_s:
            return
        bad, good = counts.bad - before.bad, counts.frames - before.frames
        was_noisy, is_many = self._is_noisy, bad >= NOISE_MIN and bad >= NOISE_SHARE * (bad + good)
        self._is_noisy = is_many or (was_noisy and bad > 0)
        if self._is_noisy and not was_noisy:
            text = CORRUPT.format(bad / (bad + good), bad / (run_s - since_s))
            self._log.warning(self._messages.message(text))
        was_crowded, self._is_crowded = self._is_crowded, good > FRAMES_MAX_PER_S * (run_s - since_s)
        if self._is_crowded and not was_crowded:
            self._log.warning(self._messages.message(TOO_MANY.format(good / (run_s - since_s))))

    def _say(self, event: str, run_s: float, **values: object) -> None:
        """Log an event, or count it if there were many of its kind."""
        left_out = self._limits[event].take(run_s)
        if left_out is not None:
            write = self._log.info if event == "line back" else self._log.warning
            write(event, **values, **_more(left_out))


def differences(robot: Identity, before: Identity) -> str:
    """Return what a robot says of itself in another way than the one before; empty if all is the same.

    What only one of them says is no difference: an answer may be lost.
    """
    then = dict(_facts(before))
    return ", ".join(
        f"{name} {value} in place of {then[name]}" for name, value in _facts(robot) if then.get(name, value) != value
    )


def _facts(robot: Identity) -> Iterator[tuple[str, str]]:
    yield "name", f"'{robot.name}'"
    yield "sensors", str(robot.sensors)
    yield "radius of the ring", f"{robot.ring_radius_m:.3f} m"
    yield from robot.traits


def _more(left_out: int) -> dict[str, int]:
    return {"suppressed_before": left_out} if left_out else {}
