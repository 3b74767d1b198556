"""The log of missions: each step that begins, and how a mission ends, for the log and the summary of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypedDict

from behaviors.missions.mission import Mission
from drivers.token_bucket import LineLimit
from runtime.cycle.drive_requests import DriveRequest

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LINES_PER_S: Final = 1.0
LINES_BURST: Final = 100.0
"""Lines at once: a step whose condition holds at once ends in the cycle in which it began."""
STEPS_MAX: Final = 1000
"""Steps that are kept; the oldest are dropped."""


class MissionStepRow(TypedDict):
    """A step of a mission that was begun, or the mission's state in it."""

    after_s: float
    """When, s since the run's first cycle, without its pauses."""
    step: str
    status: str
    """running, held, done or failed."""
    reason: str | None
    """Why it is not running."""


class MissionRow(TypedDict):
    """The last mission of a run: where it was at the end, and its newest steps, oldest first."""

    name: str
    step: str
    status: str
    reason: str | None
    steps: list[MissionStepRow]


class MissionLog:
    """Logs how a mission goes on."""

    def __init__(self, log: FilteringBoundLogger) -> None:
        self.row: MissionRow | None = None
        """The last mission, for the summary; None if there was none."""
        self._log = log
        self._last: tuple[str, int, str] | None = None
        self._begin_run_s: float | None = None
        self._limit = LineLimit(LINES_PER_S, LINES_BURST)

    def observe(self, request: DriveRequest, run_s: float) -> None:
        """Note the mission's step and status where they changed; `run_s` is the run's clock, in every cycle."""
        if self._begin_run_s is None:
            self._begin_run_s = run_s
        if not isinstance(request, Mission):
            return
        name, progress = request.plan.name, request.progress
        now = (name, progress.changes, progress.status)
        if now == self._last:
            return
        self._last = now
        step, status, reason = request.step.name, progress.status, progress.reason
        after_s = round(run_s - self._begin_run_s, 3)
        row: MissionStepRow = {"after_s": after_s, "step": step, "status": status, "reason": reason}
        before = [] if self.row is None or self.row["name"] != name else self.row["steps"]
        steps = [*before[1 - STEPS_MAX :], row]
        self.row = {"name": name, "step": step, "status": status, "reason": reason, "steps": steps}
        if self._limit.take(run_s) is not None:
            self._log.info("mission", mission=name, step=step, status=status, reason=reason)
