"""The detour of the schema leave-canyon: when it ends, turns to its other side, or is given up."""

from __future__ import annotations

import math
from dataclasses import replace

from behaviors.memory.detour import FARTHER_M, LOOP_M, STALL_M, TURNED_BACK_RAD, Detour
from behaviors.surroundings.blocked_ahead import Block
from perception.percept import Pose

GOAL = (5.0, 0.0)
BEGAN = Detour(side=1, began_m=5.0, nearest_m=5.0, driven_m=9.0)
BLOCK = Block(axis_rad=0.0, x=0.0, y=0.0, front_m=1.0, back_m=2.0, low_m=-1.0, high_m=1.0)


def test_a_robot_that_drives_and_comes_no_nearer_is_held() -> None:
    nearer = BEGAN.nearer(4.5)
    assert (nearer.nearest_m, nearer.nearest_driven_m) == (4.5, 9.0)
    assert nearer.nearer(4.45) is nearer, "too little to count"
    assert not nearer.is_held
    assert replace(nearer, driven_m=9.0 + STALL_M).is_held


def test_it_ends_nearer_to_the_goal_and_past_what_is_only_presumed() -> None:
    assert BEGAN.ends_at(4.0, 1.3)
    assert not BEGAN.ends_at(4.9, 9.0)
    presumed = replace(BEGAN, block=BLOCK)
    assert not presumed.ends_at(4.0, 1.3)
    assert presumed.ends_at(4.0, 4.0)
    assert presumed.ended().block is None


def test_one_that_began_beside_the_goal_ends_before_it_has_passed_it() -> None:
    beside = replace(BEGAN, began_m=0.62, nearest_m=0.62)
    assert beside.ends_at(0.3, 0.3)
    assert not beside.ends_at(0.35, 0.4)
    assert not beside.ends_at(0.3, 0.2), "something is between"


def test_after_a_round_it_tries_the_other_side() -> None:
    here = Pose(0.1, 0.0, 0.0)
    assert BEGAN.on_a_side_that_leads_on(here, GOAL, has_grid=False).side == -1
    early = replace(BEGAN, driven_m=0.5 * LOOP_M)
    assert early.on_a_side_that_leads_on(here, GOAL, has_grid=False) is early


def test_what_was_only_presumed_is_given_up_where_it_leads_back() -> None:
    presumed = replace(BEGAN, block=BLOCK)
    assert presumed.given_up(5.0, 0.5 * TURNED_BACK_RAD) is None
    assert BEGAN.given_up(99.0, math.pi) is None, "nothing is presumed"
    for kept in (presumed.given_up(5.0, math.pi), presumed.given_up(5.1 + FARTHER_M, 0.0)):
        assert kept is not None
        assert kept.side == 0
        assert kept.presume_below_m < 5.0
