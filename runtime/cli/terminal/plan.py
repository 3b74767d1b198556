"""A plan view in characters: segments, objects, the trail and the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from rich.text import Text

from perception.detected_object import DetectedObject

ARROWS: Final = "→↗↑↖←↙↓↘"
CELL_ASPECT: Final = 2.0
"""Height of a character cell divided by its width, on usual terminals."""
LINE_STEPS_MAX: Final = 1000
MARGIN_M: Final = 0.6
"""Space around the outermost points."""


class Plan:
    """A character raster over a rectangle of the plane that holds all given points.

    Parameters
    ----------
    points : iterable of (x, y)
        Points inside the rectangle, m.
    columns, rows : int
        Size in characters.
    """

    def __init__(self, points: Iterable[tuple[float, float]], columns: int, rows: int) -> None:
        places = list(points)
        xs, ys = [x for x, _ in places], [y for _, y in places]
        width, height = max(xs) - min(xs) + 2 * MARGIN_M, max(ys) - min(ys) + 2 * MARGIN_M
        self._columns, self._rows = columns, rows
        self._cell = max(width / columns, height / (rows * CELL_ASPECT))
        self._left = 0.5 * (max(xs) + min(xs)) - 0.5 * columns * self._cell
        self._top = 0.5 * (max(ys) + min(ys)) + 0.5 * rows * self._cell * CELL_ASPECT
        self._cells: dict[tuple[int, int], tuple[str, str]] = {}

    @property
    def cell_m(self) -> float:
        """Width of a character, m."""
        return self._cell

    def mark(self, x: float, y: float, character: str, style: str) -> None:
        """Draw a character at a point, m; points outside are ignored.

        Parameters
        ----------
        x, y : float
            The point, m.
        character : str
            One character; it replaces an earlier one in the same cell.
        style : str
            Style of the character, as rich names it.
        """
        column = math.floor((x - self._left) / self._cell)
        row = math.floor((self._top - y) / (self._cell * CELL_ASPECT))
        if 0 <= column < self._columns and 0 <= row < self._rows:
            self._cells[row, column] = (character, style)

    def circle(self, x: float, y: float, radius: float, character: str, style: str) -> None:
        """Draw a circle of characters around a point, m.

        Parameters
        ----------
        x, y, radius : float
            Centre and radius, m.
        character : str
            The character of which the circle consists.
        style : str
            Style of the characters, as rich names it.
        """
        steps = max(8, math.ceil(4.0 * math.pi * radius / self._cell))
        for k in range(steps):
            angle = 2.0 * math.pi * k / steps
            self.mark(x + radius * math.cos(angle), y + radius * math.sin(angle), character, style)

    def line(self, x1: float, y1: float, x2: float, y2: float, character: str, style: str) -> None:
        """Draw a line of characters from (x1, y1) to (x2, y2), m.

        Parameters
        ----------
        x1, y1, x2, y2 : float
            The ends, m.
        character, style : str
            As of `mark`.
        """
        steps = min(LINE_STEPS_MAX, max(1, math.ceil(math.dist((x1, y1), (x2, y2)) / self._cell)))
        for k in range(steps + 1):
            share = k / steps
            self.mark(x1 + share * (x2 - x1), y1 + share * (y2 - y1), character, style)

    def text(self) -> Text:
        """Return the raster as text."""
        text = Text(no_wrap=True)
        for row in range(self._rows):
            for column in range(self._columns):
                character, style = self._cells.get((row, column), (" ", ""))
                text.append(character, style)
            text.append("\n")
        return text


def draw_plan(
    pose: tuple[float, float, float],
    trail: list[tuple[float, float]],
    segments: list[tuple[float, float]],
    objects: tuple[DetectedObject, ...],
    size_m: dict[str, float],
    columns: int,
    rows: int,
) -> Text:
    """Return the plan as text.

    Parameters
    ----------
    pose : (x, y, theta)
        Of the robot, m and rad.
    trail : list of (x, y)
        Earlier positions, m.
    segments : list of (x, y)
        Middles of the outline segments, m.
    objects : tuple of DetectedObject
        Recognised objects.
    size_m : dict
        Radius at which to draw each model, m.
    columns, rows : int
        Size in characters.
    """
    robot_x, robot_y, theta = pose
    plan = Plan([*trail, (robot_x, robot_y), *((o.x, o.y) for o in objects), *segments], columns, rows)
    for x, y in trail:
        plan.mark(x, y, "·", "dim")
    for seen in objects:
        if seen.ends is not None:
            plan.line(*seen.ends, "=", "green")
            continue
        plan.circle(seen.x, seen.y, size_m.get(seen.model, 0.3), "o", "green")
    for x, y in segments:
        plan.mark(x, y, "•", "yellow")
    for index, seen in enumerate(objects, 1):
        plan.mark(seen.x, seen.y, str((seen.number or index) % 10), "bold green")
    eighth = round(theta / (math.pi / 4)) % 8
    plan.mark(robot_x, robot_y, ARROWS[eighth], "bold cyan")
    return plan.text()
