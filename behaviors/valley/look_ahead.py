r"""VFH*: a search over projected places, which finds the way that VFH+ alone would have to try.

After Ulrich & Borenstein, *VFH\*: Local Obstacle Avoidance with Look-Ahead Verification*, ICRA 2000. Each candidate
of VFH+ is driven a step ahead in the evidence grid, and its candidates follow from there; A* picks what is continued.
In place of weighted sectors and a fixed number of steps, costs are metres and the search ends at the goal, or where
the grid ends: what is unknown is free. A place that the search has passed is not passed again.

One call expands one place: a quantum. The search in progress is a value that is passed in and returned; until it
ends, the way found before stays in force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Annotated, Final, TypeAlias

from pydantic import Field

from behaviors.valley.choice import apart, candidates, gaps
from behaviors.valley.polar_histogram import (
    SECTOR_RAD,
    SECTORS,
    cells_near,
    crossed,
    room_m,
)
from config.behaviors import FollowValleyConfig
from config.bounded import COORDINATE_MAX, Coordinate, Count, Number
from config.robot import PASSAGE_M
from perception.percept import OccupancyWindow, Percept

Place: TypeAlias = tuple[Coordinate, Coordinate]

Square: TypeAlias = Annotated[int, Field(ge=-COORDINATE_MAX, le=COORDINATE_MAX)]

SQUARES_M: Final = 0.5
"""Places in one square of this share of a step are the same place."""
SAME: Final = 0.7
"""A place within this share of a step of one on the way in force is on that way."""
TOWARDS: Final = math.radians(45.0) / SECTOR_RAD
"""A gap that is considered leads within this many sectors of the goal's direction."""
LINE_M: Final = 0.1
"""The last step to a goal is free unless something lies so near its line, m: what the grid shows beside a goal may be
the arc of an echo, which a robot that is there does not hear."""
AWAY_M: Final = 1.0
"""A robot farther than this from its way needs another one, m."""
FAILED_SEEN_M: Final = 2.5
"""From farther off a way is not known to have failed, m: what closes it may be the arc of an echo."""
FAILED_NEAR_M: Final = 0.6
FAILED_COST_M: Final = 1.0
"""A step that ends so near a place where a way has failed costs so much more each time, m."""
FAILED_MAX: Final = 64
"""Places where ways have failed that are remembered, the newest."""


@dataclass(frozen=True, slots=True)
class Node:
    """A projected place: m, in odometry's frame."""

    x: Coordinate
    y: Coordinate
    direction: Coordinate
    """In which it was reached, in sectors."""
    cost_m: Coordinate
    """Of the way to it."""
    parent: Number


@dataclass(frozen=True, slots=True)
class Search:
    """A look-ahead in progress, and the way that the last one found."""

    goal: Place | None = None
    """None before the first search."""
    nodes: tuple[Node, ...] = ()
    waiting: tuple[tuple[Coordinate, Count], ...] = ()
    """A heap of estimated costs of the whole way, m, and numbers of nodes."""
    passed: tuple[tuple[Square, Square], ...] = ()
    """Squares that are expanded."""
    way: tuple[Place, ...] = ()
    """The way in force, from where its search began; empty without one."""
    reaches: bool = True
    """Whether that way leads to the goal; otherwise to the place nearest to it that can be reached."""
    closed: tuple[Place, ...] = ()
    """The places on that way to which this search has found no step."""
    is_doubted: bool = False
    """Whether the last search has found a way that turns back from the one in force."""
    failed: tuple[Place, ...] = ()
    """Such places of former ways, which were given up for them: as the grid forgets, they would be tried again."""

    def contradiction(self) -> str | None:
        """Return which number of a place names none; None if all do."""
        if any(not -1 <= node.parent < k for k, node in enumerate(self.nodes)):
            return "a place of the search whose parent does not come before it"
        is_named = all(number < len(self.nodes) for _, number in self.waiting)
        return None if is_named else "a place that waits for the search and is not in it"

    @property
    def is_done(self) -> bool:
        """Whether the search has ended."""
        return not self.waiting


def begin(search: Search, percept: Percept, goal: Place) -> Search:
    """Return a search that starts anew from where the robot is; the way in force stays.

    Parameters
    ----------
    search : Search
        The last one.
    percept : Percept
        Only the pose is used.
    goal : tuple of float
        In odometry's frame, m.
    """
    pose = percept.pose
    root = Node(pose.x, pose.y, pose.theta / SECTOR_RAD, 0.0, -1)
    waiting = ((math.dist((pose.x, pose.y), goal), 0),)
    return replace(search, goal=goal, nodes=(root,), waiting=waiting, passed=(), closed=())


def expand(search: Search, percept: Percept, body_radius_m: float, config: FollowValleyConfig) -> Search:
    """Return the search after one quantum: the most promising place is expanded, or the search ends.

    Parameters
    ----------
    search : Search
        From `begin`, not done.
    percept : Percept
        Evidence grid and fresh echoes of this cycle.
    body_radius_m : float
        Radius of the robot, m.
    config : FollowValleyConfig
        The schema's settings.
    """
    heap, goal, step_m = list(search.waiting), search.goal or (0.0, 0.0), config.look_ahead_step_m
    while heap:
        number = heappop(heap)[1]
        node = search.nodes[number]
        square = (math.floor(node.x / (SQUARES_M * step_m)), math.floor(node.y / (SQUARES_M * step_m)))
        if square in search.passed:
            continue
        distance = math.dist((node.x, node.y), goal)
        if distance < 1e-9 or _is_beyond(percept.occupancy, node, search.nodes[0]):
            return _ended(search, number, config.carrot_m, reaches=True)
        nodes = [*search.nodes]
        children = _children(node, number, distance, search, percept, body_radius_m, config)
        for child in children:
            heappush(heap, (child.cost_m + math.dist((child.x, child.y), goal), len(nodes)))
            nodes.append(child)
        search = replace(search, closed=_closed(search, node, children, SAME * step_m))
        if len(nodes) > config.look_ahead_nodes_max:
            break
        return replace(search, nodes=tuple(nodes), waiting=tuple(heap), passed=(*search.passed, square))
    nearest = min(range(len(search.nodes)), key=lambda k: math.dist((search.nodes[k].x, search.nodes[k].y), goal))
    return _ended(search, nearest, config.carrot_m, reaches=False)


def _children(
    node: Node,
    number: int,
    distance: float,
    search: Search,
    percept: Percept,
    body_radius_m: float,
    config: FollowValleyConfig,
) -> list[Node]:
    """Return the places a step ahead of one in the directions of its candidates.

    Steps along the way in force cost less, so that another of almost the same cost does not replace it.
    """
    goal = search.goal or (0.0, 0.0)
    room_max_m = body_radius_m + config.safety_m
    step_m = min(config.look_ahead_step_m, distance)
    comfort_m = body_radius_m + config.comfort_m
    cells = cells_near(percept, node.x, node.y, step_m + comfort_m, config)
    radius_m = room_m(cells, body_radius_m, room_max_m) if number == 0 else room_max_m
    # The room in a gap is for errors in the places of its posts. A way ahead is not asked for it: from afar they
    # would count twice, and a way that is in force would come and go with them.
    is_first = number == 0 and not search.way
    least_m = min(radius_m, body_radius_m + (PASSAGE_M if is_first else 0.0))
    radii_m = (radius_m, max(radius_m, comfort_m), least_m)
    blocked, near, closed = (sectors.tobytes() for sectors in crossed(cells, radii_m, (step_m,) * 3))
    target = math.atan2(goal[1] - node.y, goal[0] - node.x) / SECTOR_RAD
    found, same, wide = [], (SAME * step_m) ** 2, math.radians(config.wide_valley_deg) / SECTOR_RAD
    free, narrow = candidates(blocked, target, wide), gaps(closed, blocked)
    if (
        step_m == distance
        and target not in free
        and not crossed(cells, (LINE_M,), (step_m,))[0, round(target) % SECTORS]
    ):
        free.append(target)
    for c in free + narrow:
        angle = c * SECTOR_RAD
        x, y = node.x + step_m * math.cos(angle), node.y + step_m * math.sin(angle)
        if c == target and step_m == distance:
            x, y = goal
        is_kept = any((kx - x) ** 2 + (ky - y) ** 2 < same for kx, ky in search.way)
        # A gap elsewhere than towards the goal is rather one between two echoes than a doorway on the way.
        if c in narrow and not is_kept and apart(c, target) > TOWARDS:
            continue
        turned_rad = apart(c, node.direction) * SECTOR_RAD
        cost_m = step_m * (1.0 + (config.near_share if near[round(c) % SECTORS] else 0.0))
        if is_kept:
            cost_m *= 1.0 - config.keep_share
        cost_m += config.turn_cost_m_per_rad * turned_rad
        cost_m += FAILED_COST_M * sum(math.dist((x, y), place) < FAILED_NEAR_M for place in search.failed)
        found.append(Node(x, y, c, node.cost_m + cost_m, number))
    return found


def _is_beyond(window: OccupancyWindow | None, node: Node, root: Node) -> bool:
    """Return whether a place lies where nothing is known, so that the way to it is as good as any to the goal."""
    if window is None:
        return math.dist((node.x, node.y), (root.x, root.y)) > AWAY_M
    rows, columns = window.occupied.shape
    return not (
        0.0 <= node.x - window.x_m < columns * window.cell_m and 0.0 <= node.y - window.y_m < rows * window.cell_m
    )


def _closed(search: Search, node: Node, children: list[Node], same_m: float) -> tuple[Place, ...]:
    """Return the closed places of the way in force, with the next one if no step from a node on it leads there."""
    away = [math.dist(place, (node.x, node.y)) for place in search.way[:-1]]
    if not away or min(away) >= same_m:
        return search.closed
    there = search.way[away.index(min(away)) + 1]
    if there in search.closed or any(math.dist(there, (child.x, child.y)) < same_m for child in children):
        return search.closed
    return (*search.closed, there)


def _ended(search: Search, number: int, carrot_m: float, *, reaches: bool) -> Search:
    """Return the search with the way to a node in force; closed places that it keeps away from have failed.

    A way that turns back from the one in force has to be found twice in turn: a gap ahead closes for an echo or two.
    """
    way: list[Place] = []
    while number >= 0:
        node = search.nodes[number]
        way.append((node.x, node.y))
        number = node.parent
    way.reverse()
    root = search.nodes[0]
    if not search.is_doubted and _turns_back(search, way, carrot_m):
        return Search(search.goal, way=search.way, reaches=search.reaches, is_doubted=True, failed=search.failed)
    given_up = [
        place
        for place in search.closed
        if math.dist(place, (root.x, root.y)) < FAILED_SEEN_M
        and min(math.dist(place, other) for other in way) > FAILED_NEAR_M
    ]
    failed = (*search.failed, *given_up)[-FAILED_MAX:]
    return Search(search.goal, way=tuple(way), reaches=reaches, failed=failed)


def _turns_back(search: Search, way: list[Place], carrot_m: float) -> bool:
    """Return whether a way leads away from where the one in force does."""
    root = search.nodes[0]
    before = carrot(search, root.x, root.y, carrot_m)
    after = carrot(Search(way=tuple(way)), root.x, root.y, carrot_m)
    if before is None or after is None:
        return False
    return (before[0] - root.x) * (after[0] - root.x) + (before[1] - root.y) * (after[1] - root.y) < 0.0


def carrot(search: Search, x: float, y: float, ahead_m: float) -> Place | None:
    """Return the place some way ahead on the way in force; None without a way, or far from it.

    Parameters
    ----------
    search : Search
        The search.
    x, y : float
        Where the robot is, in odometry's frame, m.
    ahead_m : float
        How far ahead, along the way from the point of it that is nearest to the robot, m.
    """
    nearest, leg, rest_m = AWAY_M, -1, 0.0
    way = search.way
    for k in range(len(way) - 1):
        (ax, ay), (bx, by) = way[k], way[k + 1]
        ux, uy = bx - ax, by - ay
        length = math.hypot(ux, uy)
        if length == 0.0:
            continue
        share = min(1.0, max(0.0, ((x - ax) * ux + (y - ay) * uy) / (length * length)))
        away = math.hypot(ax + share * ux - x, ay + share * uy - y)
        if away <= nearest:
            nearest, leg, rest_m = away, k, (1.0 - share) * length
    if leg < 0:
        return None
    while ahead_m > rest_m and leg + 2 < len(way):
        ahead_m -= rest_m
        leg += 1
        rest_m = math.dist(way[leg], way[leg + 1])
    (ax, ay), (bx, by) = way[leg], way[leg + 1]
    length = math.hypot(bx - ax, by - ay)
    back = max(0.0, rest_m - ahead_m) / length if length > 0.0 else 0.0
    return bx - back * (bx - ax), by - back * (by - ay)
