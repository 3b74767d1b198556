"""Drives to goals through rooms that the robot does not know, in virtual time, and what they are judged by.

A method is a controller: it gets what the driver received and commands velocities. Ours is the cycle itself; others
can take its place on the same robot, the same line and the same acoustics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol, TypeAlias

import numpy as np

from behaviors.move_to_goal import Goal
from bench.trials.random_rooms import random_room
from bench.trials.shortest_way import FreeSpace, Place, free_space, length_m, shortest_way
from config.settings import Settings
from config.world import AcousticsConfig, DrumConfig, OdometryConfig, StartConfig, WorldConfig
from drivers.driver import RobotDriver
from drivers.emulator.acoustics import clearance
from drivers.emulator.memory_transport import MemoryLine
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import compile_scene
from drivers.messages import Pose
from drivers.registry import make_device, make_driver
from perception.pipeline import Perception
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import State, apply_command, step
from runtime.timing.refinement_budget import QUANTA_PER_CYCLE, QuantumBudget

ACOUSTICS: Final = AcousticsConfig(model="specular", noise_relative=0.01, dropout=0.05)
ODOMETRY: Final = OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=0.01)
"""Odometry that is wrong by 1 %."""
PASSAGE_M: Final = 0.06
"""A passage must be wider than robot and clearance by this on either side, or it is closed to the robot."""
THERE_M: Final = 0.5
"""The robot has arrived if it says so and stands this near to the goal."""
TIMEOUT_S: Final = 45.0
TIMEOUT_FACTOR: Final = 4.0
"""A drive is late after this time and so many times what the shortest way takes at the base velocity."""
STANDS_S: Final = 40.0
"""… or once it has stood for so long."""
SHORTEST_M: Final = 3.0
"""Goals lie at least this far away."""

Outcome: TypeAlias = Literal["arrived", "touched", "gave up", "stopped", "late"]


@dataclass(frozen=True, slots=True)
class Trial:
    """A drive to be made: the world with its start, the goal (m, in the world's frame) and the shortest way to it."""

    world: WorldConfig
    goal: Place
    shortest_m: float


@dataclass(frozen=True, slots=True)
class TrialResult:
    """What became of a drive."""

    outcome: Outcome
    contacts: int
    way_m: float
    drive_s: float
    turning_rad_s: float
    """Sum of all changes of the turning rate."""
    clearance_m: float
    """Least distance between rim and surface."""


class Controller(Protocol):
    """What drives the robot in a trial."""

    def cycle(self, driver: RobotDriver, run_s: float) -> Outcome | None:
        """Run one cycle of control; return the outcome once the drive has ended by the method's own word."""


class OurCycle:
    """The cycle as it runs on the robot, with a number of refinement quanta in place of a time.

    Parameters
    ----------
    settings : Settings
        The run's.
    goal : Goal
        In odometry's frame.
    on_state : callable, optional
        Called with the state after each cycle.
    """

    def __init__(
        self, settings: Settings, goal: Goal, on_state: Callable[[float, State], None] | None = None
    ) -> None:
        self._settings = settings
        self.state = State(Perception(settings.ring, settings.models, settings.perception), drive_request=goal)
        self._budget = QuantumBudget(QUANTA_PER_CYCLE)
        self._on_state = on_state

    def cycle(self, driver: RobotDriver, run_s: float) -> Outcome | None:
        """See `Controller.cycle`."""
        state = self.state
        inputs = gather_inputs(driver, run_s, OperatorInput(Request.ARM if state.mode.mode is Mode.READY else None))
        self._budget.begin()
        step(state, inputs, self._settings, lambda command: apply_command(driver, command), self._budget)
        if self._on_state is not None:
            self._on_state(run_s, state)
        if state.mode.mode is Mode.SAFE_STOP:
            return "stopped"
        if isinstance(state.drive_request, Goal) and state.drive_request.reached:
            return "arrived"
        drive = state.goal_drive
        return None if drive is None or drive.progress.given_up is None else "gave up"


MakeController: TypeAlias = Callable[[Settings, Goal], Controller]


def run_trial(
    trial: Trial, settings: Settings, make_controller: MakeController, seed: int,
    on_truth: Callable[[float, GroundTruth], None] | None = None,
) -> TrialResult:  # fmt: skip
    """Return the result of one drive, which ends where the rim touches a surface.

    Parameters
    ----------
    trial : Trial
        World, start and goal.
    settings : Settings
        The robot's.
    make_controller : callable
        Returns the method for a goal in odometry's frame.
    seed : int
        Of noise and drift.
    on_truth : callable, optional
        Called with each cycle's time and the truth.
    """
    robot, driver = make_device(settings, trial.world, seed), make_driver(settings)
    line, scene, start = MemoryLine(driver, robot), compile_scene(trial.world), robot.truth.pose
    there = start.inverse().compose(Pose(*trial.goal, 0.0))
    controller = make_controller(settings, Goal(there.x, there.y))
    base_m_s = settings.behaviors.arbiter.base_velocity_m_s
    until_s = TIMEOUT_S + TIMEOUT_FACTOR * trial.shortest_m / base_m_s
    way_m = turning = begin_s = run_s = 0.0
    least_m, before, cycle, moved_s = math.inf, robot.truth, 0, 0.0
    outcome: Outcome | None = None
    while outcome is None and run_s < min(until_s, moved_s + STANDS_S):
        cycle += 1
        run_s = cycle / settings.cycle.rate_hz
        line.exchange(run_s)
        outcome = controller.cycle(driver, run_s)
        truth = robot.truth
        step_m = math.dist((truth.pose.x, truth.pose.y), (before.pose.x, before.pose.y))
        way_m += step_m
        moved_s = run_s if step_m > 0.0 else moved_s
        outcome = "touched" if truth.contacts else outcome
        turning += abs(truth.twist.w - before.twist.w)
        least_m = min(least_m, float(clearance(truth.pose.x, truth.pose.y, scene.circles, scene.segments)))
        begin_s = run_s if way_m == 0.0 else begin_s
        before = truth
        if on_truth is not None:
            on_truth(run_s, truth)
    if outcome == "arrived" and math.dist((before.pose.x, before.pose.y), trial.goal) > THERE_M:
        outcome = "gave up"
    return TrialResult(
        outcome or "late", before.contacts, way_m, run_s - begin_s, turning, least_m - settings.body.radius_m
    )


def figures(trials: Sequence[Trial], results: Sequence[TrialResult], base_m_s: float) -> dict[str, float]:
    """Return what the drives are judged by: shares and means; way, speed and jerk over those that arrived.

    Parameters
    ----------
    trials, results : sequence
        The drives.
    base_m_s : float
        The base velocity, m/s.
    """
    arrived = [(t, r) for t, r in zip(trials, results, strict=True) if r.outcome == "arrived"]
    row = {
        "drives": len(trials),
        "arrives_pct": 100.0 * len(arrived) / len(trials),
        "touched": sum(r.contacts > 0 for r in results),
        "gave_up": sum(r.outcome == "gave up" for r in results),
        "late": sum(r.outcome == "late" for r in results),
    }
    if arrived:
        ways = np.array([r.way_m / t.shortest_m for t, r in arrived])
        way_m, drive_s = sum(r.way_m for _, r in arrived), sum(r.drive_s for _, r in arrived)
        row |= {
            "way_mean": float(ways.mean()),
            "way_p90": float(np.quantile(ways, 0.9)),
            "speed_share": way_m / drive_s / base_m_s,
            "jerk_rad_s_per_m": sum(r.turning_rad_s for _, r in arrived) / way_m,
            "clearance_min_m": min(r.clearance_m for _, r in arrived),
        }
    return row


def closed_room_m(settings: Settings) -> float:
    """Return the radius of the disc that must fit through a passage that is open to this robot, m."""
    return settings.body.radius_m + settings.behaviors.arbiter.clearance_m + PASSAGE_M


def random_trial(seed: int, settings: Settings) -> Trial:
    """Return a drive across a random room with up to three drums.

    Parameters
    ----------
    seed : int
        Which drive.
    settings : Settings
        Of the robot that has to fit.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 53]))
    for attempt in range(1000):
        world, start = random_room(seed + 10_000 * attempt, ACOUSTICS)
        vertices = np.array(world.polygon[0].vertices_m)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        drums = tuple(
            DrumConfig(x_m=float(x), y_m=float(y), radius_m=0.3)
            for x, y in rng.uniform(low, high, (int(rng.integers(0, 4)), 2))
        )
        world = world.model_copy(update={"drum": drums, "odometry": ODOMETRY})
        space = free_space(world, closed_room_m(settings))
        for x, y in rng.uniform(low, high, (5, 2)).tolist():
            if (trial := make_trial(world, space, start, (x, y))) is not None:
                return trial
    raise AssertionError(f"no drive for seed {seed}")


def make_trial(world: WorldConfig, space: FreeSpace, start: Pose, goal: Place) -> Trial | None:
    """Return the drive between two places, None if they are too near to one another, or no way leads to the goal.

    Parameters
    ----------
    world : WorldConfig
        The world, whose start is replaced.
    space : FreeSpace
        Where the robot fits in it.
    start : Pose
        In the world's frame.
    goal : tuple of float
        The same, m.
    """
    if math.dist((start.x, start.y), goal) < SHORTEST_M:
        return None
    way = shortest_way(space, (start.x, start.y), goal)
    if way is None:
        return None
    begin = StartConfig(x_m=start.x, y_m=start.y, heading_deg=math.degrees(start.theta) % 360.0)
    return Trial(world.model_copy(update={"start": begin}), goal, length_m(way))
