"""Leave-canyon: what closes the way is gone round with a kept side, and the mouth of a known canyon is a wall."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from behaviors.arbiter import Drive, arbitrate
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.leave_canyon import SCHEMA, Place, is_closed, leave_canyon
from behaviors.memory.detour import NO_DETOUR, Detour
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.surroundings.blocked_ahead import Block
from config.behaviors import BehaviorsConfig, LeaveCanyonConfig
from perception.percept import Canyon, Floats, OccupancyWindow, Percept, Pose
from tests.behaviors.hall import BODY, STEP_S, World, clamp, echoes
from tests.behaviors.views import EVERYWHERE

CONFIG = LeaveCanyonConfig()
BLIND = LeaveCanyonConfig(look_ahead_m=0.0)
CANYON = Canyon(3, (1.0, 1.0, 1.0, -1.0), 0.0, 3.0, 0.97)
NOTHING: Floats = np.empty((0, 2))
U = World(walls=((2.0, 1.0, 5.0, 1.0), (5.0, 1.0, 5.0, -1.0), (5.0, -1.0, 2.0, -1.0)))
"""A canyon 3 m deep and 2 m wide that opens towards the origin."""


def seen(x: float, y: float, obstacles: Floats = NOTHING, canyons: tuple[Canyon, ...] = ()) -> Percept:
    return Percept(Pose(x, y, 0.0), obstacles, EVERYWHERE, canyons=canyons)


def heading_deg(percept: Percept, goal: tuple[float, float], config: LeaveCanyonConfig = CONFIG) -> float | None:
    response, _ = leave_canyon(percept, goal, NO_DETOUR, 0.381, config)
    return None if response is None else math.degrees(math.atan2(response.y, response.x))


def drive_to(world: World, goal: Goal, config: LeaveCanyonConfig, seconds: float) -> tuple[list[Pose], Goal]:
    """Drive to a goal with the schemas of a goal; the ring gives 24 echoes at once."""
    behaviors, pose, v, detour, path = BehaviorsConfig(), Pose(0.0, 0.2, 0.0), 0.0, NO_DETOUR, []
    for _ in range(round(seconds / STEP_S)):
        percept = Percept(pose, echoes(world, pose, wide=True, noise=None), EVERYWHERE)
        steer, goal = move_to_goal(percept, goal, behaviors.move_to_goal)
        if goal.reached:
            break
        around, detour = leave_canyon(percept, (goal.x, goal.y), detour, BODY.radius_m, config)
        steer = steer if around is None else around
        push = avoid_static_obstacle(percept, BODY.radius_m, behaviors.avoid_static_obstacle)
        decision = arbitrate((steer, push), percept, BODY, behaviors.arbiter, (steer.schema, AVOID))
        assert isinstance(decision, Drive), decision
        v += clamp(decision.twist.v - v, BODY.acceleration_max_m_s2 * STEP_S)
        theta = pose.theta + decision.twist.w * STEP_S
        pose = Pose(pose.x + v * STEP_S * math.cos(theta), pose.y + v * STEP_S * math.sin(theta), theta)
        path.append(pose)
        assert world.clearance(pose.x, pose.y) > BODY.radius_m
    return path, goal


def test_a_free_way_is_left_to_move_to_goal() -> None:
    assert heading_deg(seen(0.0, 0.0), (5.0, 0.0)) is None
    behind_the_goal = np.array([[3.0, 0.0]])
    assert heading_deg(seen(0.0, 0.0, behind_the_goal), (1.5, 0.0), BLIND) is None


def test_what_is_ahead_is_gone_round_with_a_side_that_is_kept() -> None:
    wall = np.column_stack([np.full(9, 1.0), np.linspace(-2.0, 1.0, 9)])
    response, detour = leave_canyon(seen(0.0, 0.0, wall), (5.0, 0.0), NO_DETOUR, 0.381, BLIND)
    assert response is not None
    assert response.schema == SCHEMA
    assert detour.side != 0
    later, kept = leave_canyon(seen(0.0, 0.1 * detour.side, wall), (5.0, 0.0), detour, 0.381, BLIND)
    assert later is not None
    assert kept.side == detour.side
    assert response.x * 0.0 + response.y * -detour.side > 0.5  # an obstacle on the left is passed to the right


@pytest.mark.parametrize(("x", "goal", "closed"), [
    (0.0, (6.0, 0.0), True), (0.0, (2.0, 0.5), False), (2.0, (6.0, 0.0), False), (5.0, (0.0, 0.0), True),
])  # fmt: skip
def test_the_mouth_is_a_wall_unless_the_robot_or_the_goal_is_inside(
    x: float, goal: tuple[float, float], closed: bool
) -> None:
    assert is_closed(CANYON, Pose(x, 0.0, 0.0), Place(*goal, 0.45), CONFIG) is closed
    doubtful = replace(CANYON, probability=0.5)
    assert not is_closed(doubtful, Pose(x, 0.0, 0.0), Place(*goal, 0.45), CONFIG)


@pytest.mark.parametrize(("y", "goal_y"), [(0.6, 0.4), (-0.6, -0.4)])
def test_a_known_canyon_is_passed_on_the_side_of_the_shorter_way(y: float, goal_y: float) -> None:
    turned = heading_deg(seen(0.0, y, canyons=(CANYON,)), (6.0, goal_y), BLIND)
    assert turned is not None
    assert 30.0 < math.copysign(turned, y * turned) < 100.0


@pytest.mark.parametrize("config", [CONFIG, BLIND], ids=["looks ahead", "blind"])
def test_it_leaves_a_canyon_and_arrives(config: LeaveCanyonConfig) -> None:
    path, goal = drive_to(U, Goal(7.0, 0.0), config, 120.0)
    assert goal.reached
    inside = [2.0 < pose.x < 5.0 and abs(pose.y) < 1.0 for pose in path]
    assert sum(b and not a for a, b in itertools.pairwise(inside)) <= 1
    if config.look_ahead_m > 0.0:
        assert not any(inside)


def test_the_same_state_gives_the_same_answer() -> None:
    percept = seen(0.0, 0.0, np.array([[1.0, 0.0], [1.0, 0.4]]))
    assert leave_canyon(percept, (5.0, 0.0), NO_DETOUR, 0.381, CONFIG) == leave_canyon(
        percept, (5.0, 0.0), NO_DETOUR, 0.381, CONFIG
    )


def test_a_detour_ends_only_nearer_to_the_goal_than_ever_before() -> None:
    """Otherwise a canyon is left and entered in turn, each time a little nearer than where the last detour began."""
    wall = np.column_stack([np.full(9, 1.0), np.linspace(-2.0, 1.0, 9)])
    _, detour = leave_canyon(seen(0.0, 0.0, wall), (5.0, 0.0), replace(NO_DETOUR, nearest_m=4.0), 0.381, BLIND)
    assert detour.began_m == 4.0
    _, going = leave_canyon(seen(0.5, 0.0), (5.0, 0.0), detour, 0.381, BLIND)
    assert going.side == detour.side
    _, over = leave_canyon(seen(1.5, 0.0), (5.0, 0.0), detour, 0.381, BLIND)
    assert over.side == 0


def test_at_the_back_of_a_narrow_dead_end_the_obstacle_is_the_other_side() -> None:
    """There is no room to drive across: the robot turns back at once, and goes on along the opposite wall."""
    x = np.arange(-2.0, 1.2, 0.1)
    y = np.arange(-1.0, 1.01, 0.1)
    pocket = np.concatenate([
        np.column_stack([x, np.ones_like(x)]), np.column_stack([x, -np.ones_like(x)]),
        np.column_stack([np.full_like(y, 1.15), y]),
    ])  # fmt: skip
    detour = replace(NO_DETOUR, side=1, began_m=5.0, wall_rad=0.5 * math.pi)
    for place in (0.15, 0.0):  # at the second one, ahead would be free again
        response, detour = leave_canyon(seen(place, 0.0, pocket), (6.0, 0.0), detour, 0.381, BLIND)
        assert response is not None
        assert abs(math.atan2(response.y, response.x)) > math.radians(140.0)
        assert detour.wall_rad == pytest.approx(-0.5 * math.pi, abs=0.7)


def test_inside_a_known_canyon_a_detour_begins_and_does_not_end() -> None:
    begin, detour = leave_canyon(seen(2.0, 0.0, canyons=(CANYON,)), (6.0, 0.0), NO_DETOUR, 0.381, BLIND)
    assert begin is not None
    going, _ = leave_canyon(seen(3.0, 0.0, canyons=(CANYON,)), (6.0, 0.0), detour, 0.381, BLIND)
    assert going is not None
    assert leave_canyon(seen(2.0, 0.0, canyons=(CANYON,)), (3.5, 0.0), NO_DETOUR, 0.381, BLIND)[0] is None


@pytest.mark.parametrize(
    ("goal", "side_m", "leaves"),
    [((2.6, 1.3), 1.6, False), ((4.3, 0.0), 4.0, False), ((5.0, 0.0), 9.0, True), ((2.6, 2.6), 9.0, False),
     ((2.6, 2.6), 1.6, True)],
)  # fmt: skip
def test_a_goal_beside_a_canyon_is_outside_only_if_something_is_between(
    goal: tuple[float, float], side_m: float, *, leaves: bool
) -> None:
    """A room is no rectangle as wide as what was taken for its mouth: goals in its corners were left, in loops.

    Where the body could not stand, its wall is not, and where nothing is heard between, it is wider.
    """
    side = np.column_stack([np.linspace(1.0, 4.0, 31), np.full(31, side_m)])
    response, _ = leave_canyon(seen(2.0, 0.7, side, canyons=(CANYON,)), goal, NO_DETOUR, 0.381, BLIND)
    assert (response is not None) is leaves


def test_a_canyon_that_need_not_be_left_chooses_no_side() -> None:
    other = Canyon(9, (2.2, 1.3, 1.4, 1.3), 0.5 * math.pi, 0.3, 0.97)
    sides = [
        leave_canyon(seen(2.0, 0.7, canyons=canyons), (2.6, 2.6), NO_DETOUR, 0.381, BLIND)[1].side
        for canyons in ((CANYON, other), (other,))
    ]
    assert sides == [1, 1], "round the end of the other one's mouth"


NARROW = Canyon(4, (1.0, 0.5, 1.0, -0.5), 0.0, 6.0, 0.97)


def leaving(
    x: float, y: float, obstacles: Floats, canyons: tuple[Canyon, ...], detour: Detour
) -> tuple[float, Detour]:  # fmt: skip
    percept = seen(x, y, obstacles, canyons)
    response, after = leave_canyon(percept, (9.0, 0.0), detour, 0.381, BLIND)
    assert response is not None
    return math.atan2(response.y, response.x), after


def test_a_narrow_canyon_is_left_by_its_middle_line_although_its_exit_is_heard_as_too_narrow() -> None:
    ends = np.array([[1.0, 0.45], [1.0, -0.45], [2.2, 0.5], [2.2, -0.5]])
    heading, detour = leaving(2.2, 0.1, ends, (NARROW,), NO_DETOUR)
    assert abs(heading) > math.radians(150.0)
    assert math.sin(heading) < 0.0, "back to the middle line"
    heading, detour = leaving(1.4, 0.0, ends, (), detour)
    assert abs(heading) == pytest.approx(math.pi), "it has forgotten the canyon"
    heading, detour = leaving(0.8, 0.0, ends, (), detour)
    assert abs(heading) == pytest.approx(math.pi), "its body is still inside"
    assert leaving(0.3, 0.0, ends, (), detour)[1].leaving is None


@pytest.mark.parametrize(("side_m", "leaves"), [(0.5, True), (9.0, False)])
def test_a_narrow_canyon_is_left_no_further_once_the_goal_beside_it_is_free(side_m: float, *, leaves: bool) -> None:
    side = np.column_stack([np.linspace(1.0, 7.0, 61), np.full(61, side_m)])
    detour = replace(NO_DETOUR, leaving=NARROW)
    response, after = leave_canyon(seen(3.0, 0.0, side, (NARROW,)), (3.0, 2.6), detour, 0.381, BLIND)
    assert (response is not None, after.leaving is not None) == (leaves, leaves)


def test_a_wide_canyon_is_left_along_its_side() -> None:
    assert leaving(3.0, 0.0, np.array([[3.0, 1.0], [3.0, -1.0]]), (CANYON,), NO_DETOUR)[1].leaving is None


def test_of_the_mouths_of_a_narrow_canyon_the_outer_one_counts() -> None:
    inner = replace(NARROW, mouth=(3.0, 0.5, 3.0, -0.5), depth_m=4.0)
    ends = np.array([[2.8, 0.45], [2.8, -0.45]])
    _, detour = leaving(4.0, 0.0, ends, (inner, NARROW), NO_DETOUR)
    assert detour.leaving == NARROW


@pytest.mark.parametrize(("x", "turns"), [(-2.8, False), (-3.6, True)])
def test_with_a_grid_a_detour_that_leads_away_tries_the_other_side_along_the_same_wall(x: float, turns: bool) -> None:
    wall = np.column_stack([np.arange(-6.0, 1.0, 0.1), np.full(70, -0.6)])
    window = OccupancyWindow(np.full((8, 8), 0.5, np.float32), 0.0, 0.0, 0.1)
    began = replace(NO_DETOUR, side=1, began_m=5.0, nearest_m=5.0, driven_m=9.0, wall_rad=-0.5 * math.pi)
    percept = replace(seen(x, 0.0, wall), occupancy=window)
    response, after = leave_canyon(percept, (5.0, -3.0), began, 0.381, BLIND)
    assert response is not None
    assert (after.side, response.x > 0.0) == ((-1, True) if turns else (1, False))
    assert leave_canyon(replace(percept, occupancy=None), (5.0, -3.0), began, 0.381, BLIND)[1].side == 1


def along_a_wall_with_a_doorway(width_m: float, last_rad: float | None = None, away_m: float = 1.0) -> float:
    """Return the heading of a robot that follows a wall on its left, before the middle of a doorway in it, rad."""
    x = np.concatenate([np.arange(-4.0, -0.5 * width_m, 0.05), [-0.5 * width_m]])
    wall = np.column_stack([np.concatenate([x, -x]), np.full(2 * len(x), away_m)])
    detour = replace(NO_DETOUR, side=1, began_m=5.0, wall_rad=math.radians(120.0))
    response, _ = leave_canyon(seen(0.0, 0.0, wall), (0.0, 5.5), detour, 0.381, BLIND, last_rad=last_rad)
    assert response is not None
    return math.atan2(response.y, response.x)


@pytest.mark.parametrize(("width_m", "passes"), [(0.9, False), (1.0, True), (1.1, True), (1.26, True)])
def test_a_doorway_that_the_robot_can_pass_is_passed_in_its_middle(width_m: float, passes: bool) -> None:
    heading = along_a_wall_with_a_doorway(width_m)
    assert (abs(heading - 0.5 * math.pi) < math.radians(16.0)) is passes
    assert passes or abs(heading) < math.radians(45.0), "past the doorway, towards the wall behind it"


def test_it_turns_steadily_where_there_is_room_and_at_once_where_there_is_not() -> None:
    wanted = along_a_wall_with_a_doorway(0.9)
    assert along_a_wall_with_a_doorway(0.9, -0.5) == pytest.approx(-0.5 + 0.15 * (wanted + 0.5))
    wanted = along_a_wall_with_a_doorway(0.9, away_m=0.8)
    assert along_a_wall_with_a_doorway(0.9, 0.6 * math.pi, away_m=0.8) == wanted, "the wall is near"


@pytest.mark.parametrize(("began_m", "goes_on"), [(5.0, True), (3.0, False)])
def test_what_was_only_presumed_is_given_up_where_it_leads_away_from_the_goal(began_m: float, goes_on: bool) -> None:
    """Otherwise the walls of a whole building were followed, one after another, for an echo ahead at the start."""
    block = Block(0.0, 0.0, 0.0, 1.0, 3.0, -0.5, 0.5)
    detour = replace(NO_DETOUR, side=-1, began_m=began_m, block=block, wall_rad=0.0)
    response, going = leave_canyon(seen(0.0, 0.0), (5.0, 0.0), detour, 0.381, CONFIG)
    assert (response is not None, going.block is not None, going.side != 0) == (goes_on,) * 3
    assert goes_on or going.presume_below_m < began_m, "nothing more is presumed before it is nearer"


def test_an_echo_that_stays_ahead_is_a_dead_end_only_without_an_evidence_grid() -> None:
    """In a building a wall answers ahead on most ways: going round each made ways up to three times as long."""
    window = OccupancyWindow(np.full((8, 8), 0.5, np.float32), 0.0, 0.0, 0.1)
    for occupancy in (None, window):
        detour = NO_DETOUR
        for k in range(40):
            percept = replace(seen(0.02 * k, 0.0, np.array([[5.0, 0.0]])), occupancy=occupancy)
            _, detour = leave_canyon(percept, (7.0, 0.0), detour, 0.381, CONFIG)
        assert (detour.block is None) is (occupancy is not None)
