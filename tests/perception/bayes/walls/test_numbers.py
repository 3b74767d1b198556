"""Each reported piece of a wall has one number, which it keeps while it grows, splits, moves its frame or merges."""

from __future__ import annotations

import numpy as np

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import Wall
from perception.bayes.reports.object_report import other_objects
from perception.bayes.walls import merging as wall_merging
from perception.bayes.walls.bins import HALF
from tests.perception.bayes.random_tracks import P
from tests.perception.bayes.rooms import fill, new_room, place_wall, refit


def numbers(wall: Wall) -> list[int]:
    return [wall.spans[k].number for k in range(wall.span_count)]


def open_up(memory: Memory, wall: Wall, low: float, high: float) -> None:
    """Let ranges pass through a part of a wall until nothing is left of it."""
    for b in range(round(low / 0.06) + HALF, round(high / 0.06) + HALF):
        of = wall.bins[b]
        of.weight = of.precision = of.offset_sum = of.range_sum = 0.0
        of.passes = 8.0
    refit(memory, wall)


def test_a_wall_is_an_object_with_a_number_which_it_keeps_as_it_grows() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.6, 0.6)
    assert numbers(wall) == [1]
    fill(memory, wall, -2.0, 1.5)
    assert numbers(wall) == [1]
    (seen,) = other_objects(memory, P, 0.5, ())
    assert (seen.model, seen.number) == ("wall", 1)


def test_of_two_pieces_the_longer_keeps_the_number_and_the_older_number_is_that_of_both_together() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -2.0, 2.0)
    open_up(memory, wall, -1.0, -0.4)
    assert numbers(wall) == [2, 1]
    fill(memory, wall, -1.0, -0.4, 20.0)
    assert numbers(wall) == [1]


def test_a_piece_too_short_to_be_reported_has_no_number() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -2.0, 2.0)
    open_up(memory, wall, -1.8, -1.2)
    assert numbers(wall) == [0, 1]
    assert memory.state["objects_numbered"][0] == 1


def test_numbers_move_with_the_readings_into_another_frame_and_into_another_wall() -> None:
    memory, room = new_room()
    main, part = room.walls[0], room.walls[1]
    place_wall(part, np.array([0.5, 0.9]), 0.002, 1.505)
    fill(memory, part, -0.6, 0.6)
    place_wall(main, np.zeros(2), 0.0, 2.0)
    fill(memory, main, -2.0, -0.5)
    assert (numbers(main), numbers(part)) == ([2], [1])
    wall_merging.merge_walls(memory, P)
    assert part.weight == 0.0
    assert set(numbers(main)) <= {1, 2}
    before = numbers(main)
    wall_merging.reframe(memory.state["room"]["walls"][0], 0)
    refit(memory, main)
    assert numbers(main) == before


def test_a_wall_in_the_place_of_one_that_ended_has_a_number_of_its_own() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    for number in (1, 2):
        place_wall(wall, np.zeros(2), 0.5 * number, 2.0)
        fill(memory, wall, -0.6, 0.6)
        assert numbers(wall) == [number]
        open_up(memory, wall, -0.7, 0.7)
        assert wall.weight == 0.0
