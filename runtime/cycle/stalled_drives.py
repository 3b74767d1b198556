"""What any drive keeps from cycle to cycle, and why it makes no progress."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from behaviors.memory.commitment import Commitment
from behaviors.memory.way_progress import ENDED_S, STALLED_S, WayProgress
from behaviors.missions.mission import Mission
from behaviors.move_ahead import Leg, along_m, given_up
from behaviors.move_to_goal import Goal
from config.behaviors import MoveAheadConfig
from perception.percept import Pose
from runtime.cycle.drive_requests import DriveRequest, Legs
from runtime.cycle.goal_drive import GoalDrive

LEG_STALLED: Final = (
    f"no farther along the leg for {STALLED_S:.0f} s: something is in the way, or the schemas cancel one another; if "
    "that lasts, the leg turns back or ends"
)
GOAL_STALLED: Final = (
    f"no nearer to the goal for {STALLED_S:.0f} s: the robot looks for a way round what is between; if that lasts, "
    "the goal is given up"
)
STEP_STALLED: Final = (
    "step {} has made no progress for {:.0f} s: something is in the way, or the schemas cancel one another; if that "
    "lasts, the step is stuck"
)


@dataclass(frozen=True, slots=True)
class DriveMemory:
    """What any drive keeps from one cycle to the next, whatever is requested."""

    commitment: Commitment = field(default_factory=Commitment)
    """Of the last command."""
    progress: WayProgress = field(default_factory=WayProgress)
    """When it last made progress along legs."""


def observe_way(
    request: DriveRequest,
    leg: Leg,
    before: WayProgress | None,
    goal_drive: GoalDrive | None,
    pose: Pose,
    requested_run_s: float,
    run_s: float,
    config: MoveAheadConfig,
) -> tuple[WayProgress, Leg, str | None]:
    """Return the progress along legs, the leg, which turns back or ends without any, and why a drive has none.

    Parameters
    ----------
    request : DriveRequest
        What is driven; an operator's velocity leads where the operator sees fit.
    leg : Leg
        The leg so far.
    before : WayProgress or None
        Of the cycle before; None if the robot stands for a reason, as it should.
    goal_drive : GoalDrive or None
        The drive to a goal, which keeps its own progress, as a mission does.
    pose : Pose
        The robot's, in odometry's frame.
    requested_run_s, run_s : float
        When the request was made, and now, by the run's clock, s.
    config : MoveAheadConfig
        Of the legs.
    """
    progress, stalled_s, stalled = WayProgress(), 0.0, GOAL_STALLED
    nearer_run_s = run_s if goal_drive is None else goal_drive.progress.nearer_run_s
    match request:
        case Goal():
            stalled_s = 0.0 if request.reached else run_s - nearer_run_s
        case Mission(progress=mission):
            stalled = STEP_STALLED.format(request.step.name, STALLED_S)
            to_goal = goal_drive is not None and request.step.goal is not None
            stalled_s = run_s - nearer_run_s if to_goal else mission.step_s - mission.best_s
        case Legs() if before is not None:
            progress = before.observe(-along_m(pose, leg, config), requested_run_s, run_s, outbound=leg.outbound)
            stalled, stalled_s = LEG_STALLED, progress.stalled_s(run_s)
            leg = given_up(leg, config) if stalled_s >= ENDED_S else leg
    return progress, leg, stalled if stalled_s >= STALLED_S else None
