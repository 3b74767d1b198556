"""Alerts to the operator about sensors and odometry; each is sent once, at a bounded rate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from drivers.driver import Received
from drivers.messages import Flags
from drivers.token_bucket import LineLimit
from perception.localization.localized_pose import Status
from perception.pipeline import Perception
from perception.sensor_faults.report import SensorReport
from runtime.cycle.step import State

if TYPE_CHECKING:
    from perception.localization.known_room.known_room import KnownRoom
    from perception.localization.submaps.echo_lag import EchoLag

LINES_PER_S: Final = 1.0
LINES_BURST: Final = 60.0
"""Lines at once: two for each sensor of a ring, and some."""

BATTERY_PER_S: Final = 1.0 / 600.0
"""Lines on a battery that stays low, 1/s: a reminder every ten minutes."""
BATTERY: Final = (
    "the base reports that its battery is low: charge it, or, if it is full, check what measures its voltage"
)


class Alerts:
    """Detects new facts from cycle to cycle."""

    def __init__(self) -> None:
        self._limit = LineLimit(LINES_PER_S, LINES_BURST)
        self._changes = 0
        self._waiting = 0
        self._reported: dict[int, SensorReport] = {}
        self._place: tuple[Status, int, int] = ("localizing", 0, 0)
        """Of the known room: status, places refuted, rivals."""
        self._ring_problems: set[str] = set()
        self._has_told_lag = False
        self._silence: str | None = None
        self._battery = LineLimit(BATTERY_PER_S, 1.0)
        self.recovered: list[str] = []
        """Of the last update: what is well again, and needs nobody."""

    def update(self, received: Received, state: State, run_s: float) -> list[str]:
        """Return a line for each new fact that asks for attention: what happened, likely cause, next action.

        `state` is that after the cycle that begins at `run_s`. Where a robot causes too many lines, a later one says
        how many were left out.
        """
        facts, recovered = self._new_facts(received, state.perception)
        if (problem := state.ring_problem) is not None and state.mode.reason != problem:
            facts += [] if problem in self._ring_problems else [f"while the robot does not drive: {problem}"]
            self._ring_problems.add(problem)
        if Flags.BATTERY_LOW in received.flags and self._battery.take(run_s) is not None:
            facts.append(BATTERY)
        before, self._silence = self._silence, state.echo_watch.silence
        if before != self._silence:
            facts += [] if self._silence is None else [self._silence]
            recovered += ["the ring hears echoes again"] if self._silence is None else []
        lines, self.recovered = self._limited(facts, run_s), self._limited(recovered, run_s)
        return lines

    def _limited(self, facts: list[str], run_s: float) -> list[str]:
        """Return the lines for which there is time."""
        lines = []
        for line in facts:
            left_out = self._limit.take(run_s)
            if left_out is not None:
                lines.append(f"{line} ({left_out} such lines were left out before)" if left_out else line)
        return lines

    def _new_facts(self, received: Received, perception: Perception) -> tuple[list[str], list[str]]:
        """Return what asks for attention, and what is well again."""
        lost, recovered = self._new_place(perception.known_room)
        lines = [*received.notes, *self._new_waiting(perception), *lost, *self._new_lag(perception.echo_lag)]
        if perception.sensor_monitor.changes == self._changes:
            return lines, recovered
        self._changes = perception.sensor_monitor.changes
        now = {report.sensor: report for report in perception.sensor_reports()}
        lines += [report.reason for sensor, report in now.items() if self._is_new(report)]
        recovered += [f"sensor {sensor} works again and is used" for sensor in self._reported if sensor not in now]
        self._reported = now
        return lines, recovered

    def _new_lag(self, lag: EchoLag | None) -> list[str]:
        """Return what is new of the lag of ranges behind odometry."""
        if lag is None or self._has_told_lag or lag.lag_s == lag.given_s:
            return []
        self._has_told_lag, found = True, lag.found()
        return [
            f"{found}, as the echoes show: recognition takes it into account from now on; with "
            f"echo_lag_s = {lag.lag_s:.2f} in the robot file's [ring] it does so from the start"
        ]

    def _new_place(self, room: KnownRoom | None) -> tuple[list[str], list[str]]:
        """Return what is new of the robot's place in a known room, as of `_new_facts`."""
        lines, recovered = list[str](), list[str]()
        if room is None:
            return lines, recovered
        status, refuted, rivals = self._place
        self._place = room.status, room.refuted, room.rivals
        if self._place == (status, refuted, rivals):
            return lines, recovered
        if room.refuted > refuted:
            lines.append(
                "the readings do not fit the place that was named for the robot: it searches the whole room; "
                "goals in the map wait"
            )
        elif room.status == "lost" != status:
            lines.append(
                "the robot's place is lost: the readings do not fit it any more, as if the robot was carried or the "
                "room changed; it searches the whole room; goals in the map wait; move it by hand control, or say "
                "where it is"
            )
        if room.status == "tracking" != status:
            here = room.localized().pose
            recovered.append(f"the robot's place is known: ({here.x:.2f} m, {here.y:.2f} m) in the map")
        if room.rivals > rivals == 0:
            lines.append(
                f"the readings fit {room.rivals + 1} places of this room alike: drive to where they differ, or say "
                "where the robot is"
            )
        return lines, recovered

    def _is_new(self, report: SensorReport) -> bool:
        """Return whether a sensor's fault is another one than before; the figures in its reason may change."""
        before = self._reported.get(report.sensor)
        return before is None or before.fault != report.fault

    def _new_waiting(self, perception: Perception) -> list[str]:
        """Return a line if objects have begun to wait for room in perception."""
        before, self._waiting = self._waiting, perception.counts.waiting
        if before or not self._waiting:
            return []
        return [
            f"{self._waiting} objects near the robot have no room: more are near than perception can work on at a "
            "time; the farthest wait, their places are kept; raise perception.bayes.tracks_max"
        ]
