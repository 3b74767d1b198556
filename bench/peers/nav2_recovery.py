"""The recovery sequence of nav2 around the schemas of before.

Less than 0.5 m in 10 s is stuck; then it spins, waits and backs up in turns, at most six times.
"""

from __future__ import annotations

import math
from typing import Final

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from bench.trials.navigation_trials import Outcome
from config.settings import Settings
from drivers.driver import RobotDriver
from perception.pipeline import Perception
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import State, apply_command, step
from runtime.timing.refinement_budget import QUANTA_PER_CYCLE, QuantumBudget

MOVED_M: Final = 0.5
TIMEOUT_S: Final = 10.0
RETRIES: Final = 6
SPIN_RAD: Final = 1.57
SPIN_RAD_S: Final = 0.7
WAIT_S: Final = 5.0
BACK_M: Final = 0.3
BACK_M_S: Final = 0.15
RECOVERIES: Final = (
    (SPIN_RAD / SPIN_RAD_S, Teleoperate(0.0, SPIN_RAD_S)),
    (WAIT_S, Teleoperate(0.0, 0.0)),
    (BACK_M / BACK_M_S, Teleoperate(-BACK_M_S, 0.0)),
)
"""Time of each, s, and its velocity; costmaps, which are cleared first, there are none."""


class Nav2Recovery:
    """The schemas of before, with nav2's progress checker and recoveries.

    Parameters
    ----------
    settings : Settings
        The run's, without follow-valley.
    goal : Goal
        In odometry's frame.
    """

    def __init__(self, settings: Settings, goal: Goal) -> None:
        self._settings = settings
        self._goal = goal
        self._state = State(Perception(settings.ring, settings.models, settings.perception), drive_request=goal)
        self._budget = QuantumBudget(QUANTA_PER_CYCLE)
        self._from: tuple[float, float, float] | None = None
        self._recovery: tuple[float, Teleoperate] | None = None
        self._tries = 0

    def cycle(self, driver: RobotDriver, run_s: float) -> Outcome | None:
        """See `Controller.cycle`."""
        state = self._state
        request = Request.ARM if state.mode.mode is Mode.READY else None
        drive_request = self._request(run_s) if state.mode.mode is Mode.DRIVE else None
        inputs = gather_inputs(driver, run_s, OperatorInput(request, drive_request))
        self._budget.begin()
        step(state, inputs, self._settings, lambda command: apply_command(driver, command), self._budget)
        if isinstance(state.drive_request, Goal) and state.drive_request.reached:
            return "arrived"
        if state.mode.mode is Mode.SAFE_STOP:
            return "stopped"
        return "gave up" if self._tries > RETRIES else None

    def _request(self, run_s: float) -> DriveRequest | None:
        """Return the request of this cycle, None for the one in force."""
        assert self._state.odometry is not None
        pose = self._state.odometry.pose
        if self._recovery is not None:
            until_s, velocity = self._recovery
            if run_s < until_s:
                return velocity
            self._recovery, self._from = None, (pose.x, pose.y, run_s)
            return self._goal
        if self._from is None or math.hypot(pose.x - self._from[0], pose.y - self._from[1]) > MOVED_M:
            self._from = (pose.x, pose.y, run_s)
        elif run_s - self._from[2] > TIMEOUT_S:
            lasting_s, velocity = RECOVERIES[self._tries % len(RECOVERIES)]
            self._tries += 1
            self._recovery = run_s + lasting_s, velocity
            return velocity
        return None
