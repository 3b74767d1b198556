"""What any drive keeps from cycle to cycle, and why it makes no progress."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from behaviors.commitment import Commitment
from behaviors.missions.mission import Mission
from behaviors.move_ahead import Leg, given_up
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from behaviors.way_progress import ENDED_S, STALLED_S, WayProgress
from config.behaviors import MoveAheadConfig
from perception.percept import Pose
from runtime.cycle.drive_requests import DriveRequest

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
    """When it last made progress."""


def observe_way(
    request: DriveRequest, leg: Leg, before: WayProgress | None, pose: Pose, remaining_m: float | None,
    requested_run_s: float, run_s: float, config: MoveAheadConfig,
) -> tuple[WayProgress, Leg, str | None]:  # fmt: skip
    """Return the progress after a cycle, the leg, which turns back or ends without any, and why there is none.

    Parameters
    ----------
    request : DriveRequest
        What is driven; an operator's velocity leads where the operator sees fit.
    leg : Leg
        The leg so far.
    before : WayProgress or None
        Of the cycle before; None if the robot stands for a reason, as it should.
    pose, remaining_m, run_s
        As for `WayProgress.observe`.
    requested_run_s : float
        When the request was made, by the run's clock, s.
    config : MoveAheadConfig
        Of the legs.
    """
    if isinstance(request, Teleoperate) or before is None:
        return WayProgress(), leg, None
    part, stalled = 0, GOAL_STALLED
    if isinstance(request, Mission):
        part, stalled = request.progress.changes, STEP_STALLED.format(request.step.name, STALLED_S)
    elif not isinstance(request, Goal):
        part, stalled = int(leg.outbound), LEG_STALLED
    progress = before.observe(pose, remaining_m, part, requested_run_s, run_s)
    stalled_s = progress.stalled_s(run_s)
    if stalled is LEG_STALLED and stalled_s >= ENDED_S:
        leg = given_up(leg, config)
    return progress, leg, stalled if stalled_s >= STALLED_S else None
