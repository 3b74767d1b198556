"""Tests of the plan in characters: its size and directions, and what covers what."""

from __future__ import annotations

import math

import pytest

from perception.detected_object import DetectedObject
from runtime.cli.terminal.plan import ARROWS, MARGIN_M, Plan, draw_plan

START = (0.0, 0.0, 0.0)


def seen(x: float, y: float, model: str = "semicircle") -> DetectedObject:
    return DetectedObject(model, x, y, 0.5, 0.01, 39, 0.9)


def rows(
    pose: tuple[float, float, float] = START,
    *,
    trail: list[tuple[float, float]] | None = None,
    segments: list[tuple[float, float]] | None = None,
    objects: tuple[DetectedObject, ...] = (),
) -> list[str]:
    return draw_plan(pose, trail or [], segments or [], objects, {"semicircle": 0.3048}, 60, 20).plain.split("\n")


def where(lines: list[str], character: str) -> list[tuple[int, int]]:
    return [(i, j) for i, line in enumerate(lines) for j, c in enumerate(line) if c == character]


def test_the_plan_has_its_size_and_x_right_and_y_up() -> None:
    lines = rows(trail=[(-1.0, 0.0)], objects=(seen(2.0, 1.0), seen(2.0, -1.0)))
    assert [len(line) for line in lines] == [60] * 20 + [0]
    ((robot_row, robot_column),) = where(lines, "→")
    ((first_row, first_column),) = where(lines, "1")
    ((second_row, second_column),) = where(lines, "2")
    ((trail_row, trail_column),) = where(lines, "·")
    assert trail_column < robot_column < first_column == second_column
    assert first_row < robot_row < second_row
    assert trail_row == robot_row


def test_objects_are_rings_of_their_size() -> None:
    lines = rows(objects=(seen(2.0, 0.0),))
    marks = [j for _, j in where(lines, "o")]
    plan = Plan([(0.0, 0.0), (2.0, 0.0)], 60, 20)
    assert (max(marks) - min(marks)) * plan.cell_m == pytest.approx(2 * 0.3048, abs=2 * plan.cell_m)
    rows_of = [i for i, _ in where(lines, "o")]
    assert (max(rows_of) - min(rows_of)) * 2 * plan.cell_m == pytest.approx(2 * 0.3048, abs=4 * plan.cell_m)


def test_segments_are_marked() -> None:
    lines = rows(segments=[(1.0, 1.0), (2.0, -1.0)])
    (upper, lower) = where(lines, "•")
    assert upper[0] < where(lines, "→")[0][0] < lower[0]
    assert upper[1] < lower[1]


def test_the_arrow_points_where_the_wheels_drive() -> None:
    for eighth in range(-9, 10):
        lines = rows((0.0, 0.0, eighth * math.pi / 4 + 0.1))
        assert len(where(lines, ARROWS[eighth % 8])) == 1, eighth


def test_the_robot_is_on_top_and_what_is_outside_is_left_out() -> None:
    lines = rows((1.0, 0.0, 0.0), trail=[(1.0, 0.0)], objects=(seen(1.0, 0.0),))
    assert len(where(lines, "→")) == 1
    assert where(lines, "1") == []
    plan = Plan([(0.0, 0.0)], 10, 5)
    for x, y in ((0.0, 1e6), (1e6, 0.0), (-1e6, 0.0), (0.0, -1e6)):
        plan.mark(x, y, "x", "")
    assert "x" not in plan.text().plain
    assert plan.cell_m == pytest.approx(max(2 * MARGIN_M / 10, 2 * MARGIN_M / 10))
