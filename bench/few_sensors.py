"""Ten minutes of drives to goals with few sensors: contacts, arrivals, and the drums that were driven round.

Each room is closed, 8 to 10 m by 5 to 7 m, with two boxes and up to three drums. The robot is given a goal 6 m away
at least, then the next one, until the time is over. Contacts and places are the emulator's truth.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, get_args

import numpy as np
from rich.table import Table

from behaviors.move_to_goal import Goal
from bench.sparse_rings import RINGS, with_ring
from bench.trials.drumless_rooms import drumless_room
from bench.trials.navigation_trials import TIMEOUT_FACTOR, TIMEOUT_S, closed_room_m
from bench.trials.shortest_way import FreeSpace, Place, free_space, length_m, shortest_way
from config.load import load_settings
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, StartConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.memory_transport import MemoryLine
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import compile_scene
from drivers.messages import Floats, Pose
from drivers.registry import make_device, make_driver
from perception.detected_object import turned_object
from perception.localization.room.expected_ranges import Reflection
from perception.pipeline import Perception
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import State, apply_command, step
from runtime.simulation.open_loop import match_objects
from runtime.timing.refinement_budget import QUANTA_PER_CYCLE, QuantumBudget

SPANS_M: Final = ((8.0, 10.0), (5.0, 7.0))
AWAY_M: Final = 6.0
"""Least distance of a goal in a straight line."""
DRUMS: Final = (1, 3)
APART_M: Final = 0.9
"""Least distance from a drum to whatever else: the robots pass between them."""
NEAR_M: Final = 1.5
"""A drum is looked at from a place this near to its surface; it was driven round once such places …"""
ROUND_RAD: Final = math.pi
"""… lie in directions from it that span so much, rad."""
NO_WAY: Final = "the room leaves this robot no way to a goal"
SECTORS: Final = 12
"""Directions from a drum that are distinguished."""


@dataclass(slots=True)
class RoomResult:
    """What became of the drives in one room."""

    robot: str
    reflection: Reflection
    seed: int
    contacts: int = 0
    goals: int = 0
    arrived: int = 0
    reasons: dict[str, int] = field(default_factory=dict)
    """Why it did not arrive."""
    way_m: float = 0.0
    drums: int = 0
    round: int = 0
    """Drums that were driven round, and those of them that were found."""
    found: int = 0
    false: int = 0


def settings_of(robot: str) -> Settings:
    """Return the settings of a shipped robot, or of one of `RINGS`, with drums to recognise."""
    if robot in RINGS:
        return with_ring(load_settings("office", ["models=['drum']"], robot="denning"), robot)
    return load_settings("office", ["models=['drum']"], robot=robot)


def make_world(seed: int, reflection: Reflection) -> WorldConfig:
    """Return a room with boxes and drums."""
    rng = np.random.default_rng([seed, 43])
    room = drumless_room(
        seed,
        AcousticsConfig(model=reflection, noise_relative=0.01, dropout=0.05),
        is_cluttered=False,
        spans_m=SPANS_M,
    )
    world = room.world
    for _ in range(int(rng.integers(*DRUMS, endpoint=True))):
        scene = compile_scene(world)
        for _ in range(50):
            x, y = room.place(*rng.uniform(-0.4, 0.4, 2).tolist())
            if clearance(x, y, scene.circles, scene.segments) > FOOT_M + APART_M:
                world = world.model_copy(update={"drum": (*world.drum, DrumConfig(x_m=x, y_m=y, radius_m=FOOT_M))})
                break
    return world


def next_goal(rng: np.random.Generator, space: FreeSpace, here: Place, room_m: Place) -> tuple[Place, float] | None:
    """Return a place `AWAY_M` away and the length of the shortest way to it, m; None where there is none.

    From the middle of a small room, where a robot has given up a goal, it is the farthest of many places.
    """
    nearer: list[Place] = []
    for _ in range(300):
        there = (float(rng.uniform(-room_m[0], room_m[0])), float(rng.uniform(-room_m[1], room_m[1])))
        if math.dist(here, there) < AWAY_M:
            nearer.append(there)
        elif (way := shortest_way(space, here, there)) is not None:
            return there, length_m(way)
    for there in sorted(nearer, key=lambda place: math.dist(here, place), reverse=True):
        if (way := shortest_way(space, here, there)) is not None:
            return there, length_m(way)
    return None


def run_room(
    robot: str,
    reflection: Reflection,
    seed: int,
    seconds: float,
    on_state: Callable[[float, State, GroundTruth], None] | None = None,
) -> RoomResult:
    """Return the result of one room.

    Parameters
    ----------
    robot, reflection, seed
        As in `RoomResult`.
    seconds
        How long the robot drives.
    on_state
        Called after each cycle with its time, the state and the truth.
    """
    settings, result = settings_of(robot), RoomResult(robot, reflection, seed)
    world, rng = make_world(seed, reflection), np.random.default_rng([seed, 44])
    space = free_space(world, closed_room_m(settings))
    corners = np.array([(wall.x1_m, wall.y1_m) for wall in world.wall])
    reach = (float(np.abs(corners[:, 0]).max()), float(np.abs(corners[:, 1]).max()))
    places = [space.place((i, j)) for i, j in np.argwhere(space.free).tolist()]
    inside = sorted((place for place in places if _inside(place, corners)), key=lambda place: -math.hypot(*place))
    # A small robot also has room within a box, where no way leads out.
    leads_on = (place for place in inside if next_goal(np.random.default_rng(seed), space, place, reach) is not None)
    if (begin := next(leads_on, None)) is None:
        result.reasons[NO_WAY] = 1
        return result
    start = StartConfig(x_m=begin[0], y_m=begin[1], heading_deg=float(rng.uniform(-180.0, 180.0)))
    world = world.model_copy(update={"start": start})
    device, driver = make_device(settings, world, seed), make_driver(settings)
    line, origin = MemoryLine(driver, device), device.truth.pose
    state = State(Perception(settings.ring, settings.models, settings.perception))
    budget, looked = QuantumBudget(QUANTA_PER_CYCLE), np.zeros((len(world.drum), SECTORS), dtype=np.bool_)
    base_m_s = min(settings.behaviors.arbiter.base_velocity_m_s, settings.body.speed_max_m_s)
    until_s, before, goal_set = 0.0, device.truth, False
    for cycle in range(1, round(seconds * settings.cycle.rate_hz) + 1):
        run_s = cycle / settings.cycle.rate_hz
        line.exchange(run_s)
        pose, request = device.truth.pose, None
        if not goal_set and state.mode.mode in {Mode.READY, Mode.DRIVE, Mode.SAFE_STOP}:
            asked = next_goal(rng, space, (pose.x, pose.y), reach)
            if asked is None:
                break
            there = origin.inverse().compose(Pose(*asked[0], 0.0))
            request, goal_set = Goal(there.x, there.y), True
            until_s = run_s + TIMEOUT_S + TIMEOUT_FACTOR * asked[1] / base_m_s
            result.goals += 1
        arm = Request.ARM if state.mode.mode in {Mode.READY, Mode.SAFE_STOP} and goal_set else None
        inputs = gather_inputs(driver, run_s, OperatorInput(arm, request))
        budget.begin()
        step(state, inputs, settings, lambda command: apply_command(driver, command), budget)
        truth = device.truth
        if on_state is not None:
            on_state(run_s, state, truth)
        result.way_m += math.dist((truth.pose.x, truth.pose.y), (before.pose.x, before.pose.y))
        before = truth
        for k, drum in enumerate(world.drum):
            off = (truth.pose.x - drum.x_m, truth.pose.y - drum.y_m)
            if math.hypot(*off) < drum.radius_m + NEAR_M:
                looked[k, int((math.atan2(off[1], off[0]) % math.tau) / math.tau * SECTORS) % SECTORS] = True
        if goal_set and request is None and (outcome := _outcome(state, run_s > until_s)) is not None:
            result.arrived += outcome == "arrived"
            if outcome != "arrived":
                result.reasons[outcome] = result.reasons.get(outcome, 0) + 1
            goal_set = False
    result.goals -= goal_set  # the last one was under way
    result.contacts = before.contacts
    seen = [turned_object(origin, one) for one in state.perception.objects()]
    rows, _, result.false = match_objects(world, seen, settings.models)
    is_round = looked.sum(axis=1) * math.tau / SECTORS >= ROUND_RAD
    result.drums, result.round = len(world.drum), int(is_round.sum())
    result.found = sum(bool(is_round[k]) and row["estimate"] is not None for k, row in enumerate(rows))
    return result


def _inside(place: Place, corners: Floats) -> bool:
    """Return whether a place lies in the room, whose corners run counter-clockwise."""
    along, to = np.roll(corners, -1, axis=0) - corners, np.array(place) - corners
    return bool((along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0] > 0.0).all())


def _outcome(state: State, is_late: bool) -> str | None:
    """Return "arrived" or why the drive to this goal has ended; None while it goes on."""
    goal, drive = state.drive_request, state.goal_drive
    if state.mode.mode is Mode.SAFE_STOP:
        return str(state.mode.reason)
    if isinstance(goal, Goal) and goal.reached:
        return "arrived"
    if drive is not None and drive.progress.given_up is not None:
        return drive.progress.given_up
    return f"late: {state.hold_reason or 'under way'}" if is_late else None


def measure(
    robots: Sequence[str], seeds: Sequence[int], seconds: float, tell: Callable[[str], None]
) -> list[RoomResult]:
    """Return the results of all robots in all rooms, by both models of reflection."""
    results: list[RoomResult] = []
    for robot in robots:
        for reflection in get_args(Reflection):
            for seed in seeds:
                results.append(run_room(robot, reflection, seed, seconds))
                tell(str(results[-1]))
    return results


def few_sensors_table(results: Sequence[RoomResult]) -> Table:
    """Return a row for each robot and model of reflection."""
    table = Table(title="drives to goals 6 m away in closed rooms with boxes and drums, one after another")
    for heading in ("robot", "surfaces", "rooms", "way, m", "contacts", "arrived", "drums", "false", "why not"):
        table.add_column(heading)
    for robot, reflection in dict.fromkeys((one.robot, one.reflection) for one in results):
        of = [one for one in results if (one.robot, one.reflection) == (robot, reflection)]
        reasons: Counter[str] = sum((Counter(one.reasons) for one in of), Counter())
        table.add_row(
            robot,
            reflection,
            str(len(of)),
            f"{sum(one.way_m for one in of):.0f}",
            str(sum(one.contacts for one in of)),
            f"{sum(one.arrived for one in of)}/{sum(one.goals for one in of)}",
            f"{sum(one.found for one in of)}/{sum(one.round for one in of)}",
            str(sum(one.false for one in of)),
            "; ".join(f"{count} {reason[:60]}" for reason, count in reasons.most_common(3)),
        )
    return table
