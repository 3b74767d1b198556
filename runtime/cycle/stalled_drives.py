"""What any drive keeps from cycle to cycle, and why it makes no progress."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from behaviors.memory.commitment import Commitment
from behaviors.memory.way_progress import ENDED_S, STALLED_S, WayProgress, due_m
from behaviors.missions.mission import Mission
from behaviors.move_ahead import Leg, along_m, given_up
from behaviors.move_to_goal import Goal
from config.settings import Settings
from perception.percept import Pose
from runtime.cycle.drive_requests import DriveRequest, Legs
from runtime.cycle.goal_drive import GoalDrive

if TYPE_CHECKING:
    from runtime.cycle.drive_state import Moment

LEG_STALLED: Final = (
    "less than {gain_m:.2g} m farther along the leg for {stalled_s:.0f} s: something is in the way, or the schemas "
    "cancel one another; if that lasts, the leg turns back or ends"
)
GOAL_STALLED: Final = (
    "less than {gain_m:.2g} m nearer to the goal for {stalled_s:.0f} s: the robot looks for a way round what is "
    "between; if that lasts, the goal is given up"
)
STEP_STALLED: Final = (
    "step {step} has made no progress for {stalled_s:.0f} s: something is in the way, or the schemas cancel one "
    "another; if that lasts, the step is stuck"
)


@dataclass(frozen=True, slots=True)
class DriveMemory:
    """What any drive keeps from one cycle to the next, whatever is requested."""

    commitment: Commitment = field(default_factory=Commitment)
    """Of the last command."""
    progress: WayProgress = field(default_factory=WayProgress)
    """When it last made progress."""


def observe_way(
    request: DriveRequest,
    leg: Leg,
    before: WayProgress,
    goal_drive: GoalDrive | None,
    pose: Pose,
    requested_run_s: float,
    now: Moment,
    settings: Settings,
    *,
    stands: bool,
) -> tuple[WayProgress, Leg, str | None]:
    """Return the progress of a drive, the leg, which turns back or ends without any, and why a drive has none.

    Parameters
    ----------
    request : DriveRequest
        What is driven; an operator's velocity leads where the operator sees fit.
    leg : Leg
        The leg so far.
    before : WayProgress
        Of the cycle before.
    goal_drive : GoalDrive or None
        The drive to a goal, of a mission's step, too.
    pose : Pose
        The robot's, in odometry's frame.
    requested_run_s : float
        When the request was made, by the run's clock, s.
    now : Moment
        When this is decided, and which speed limits are in force.
    settings : Settings
        Of the run.
    stands : bool
        Whether the robot stands for a reason, as it should.
    """
    behaviors = settings.behaviors
    limit_m_s = math.inf if now.zones is None else now.zones.slowest_m_s(pose, settings.body.radius_m)
    gain_m = due_m(min(settings.body.speed_max_m_s, behaviors.arbiter.base_velocity_m_s, limit_m_s))
    run_s = now.run_s
    progress, stalled_s, stalled = WayProgress(), 0.0, GOAL_STALLED
    nearest_m = None if goal_drive is None else goal_drive.progress.nearest_m
    match request:
        case Goal() if not request.reached and nearest_m is not None:
            progress = before.observe(nearest_m, gain_m, requested_run_s, run_s, outbound=True)
            stalled_s = progress.stalled_s(run_s)
        case Mission(progress=mission):
            stalled = STEP_STALLED
            to_goal = request.step.goal is not None
            left_m, stalled_s = (nearest_m, 0.0) if to_goal else (mission.best_m, mission.step_s - mission.best_s)
            if left_m and (to_goal or not stands):  # it leads somewhere, and not only a turn is left
                part = mission.changes
                progress = before.observe(left_m, gain_m, requested_run_s, run_s, outbound=True, part=part)
                stalled_s = progress.stalled_s(run_s)
        case Legs() if not stands:
            left_m, outbound = -along_m(pose, leg, behaviors.move_ahead), leg.outbound
            progress = before.observe(left_m, gain_m, requested_run_s, run_s, outbound=outbound)
            stalled, stalled_s = LEG_STALLED, progress.stalled_s(run_s)
            leg = given_up(leg, behaviors.move_ahead) if stalled_s >= ENDED_S else leg
    if stalled_s < STALLED_S:
        return progress, leg, None
    step = request.step.name if isinstance(request, Mission) else ""
    return progress, leg, stalled.format(gain_m=gain_m, stalled_s=STALLED_S, step=step)
