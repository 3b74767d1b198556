"""One wall is one line: walls that continue each other are merged, and those that others explain are dropped."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, Memory, StateRecord
from perception.bayes.memory.wall_records import (
    CANDIDATE,
    IS_FREE,
    MAX_WALLS,
    RECENT_READINGS_MAX,
    WALL_BIN_M,
    WALL_BINS,
    Wall,
    WallMap,
)
from perception.bayes.walls.bins import HALF, clear_wall, free, is_covered, middle_of
from perception.bayes.walls.contact import (
    BEAM_EDGE,
    FOOT,
    HIDING_PROBABILITY,
    NOWHERE,
    ONLY_NAMED,
    SAME_SIGMAS,
    SPAN_MARGIN_M,
    WENT_ON_M,
    contact,
    corner_of,
    edges_answer,
    is_from_circle,
    is_from_end,
    is_on_span,
    is_on_straight_span,
    line_variance,
    tolerance,
)
from perception.bayes.walls.evidence import FLAT_BINS_MIN, WALL_MISFIT_MAX
from perception.bayes.walls.fit import fit_walls
from perception.kernel import kernel
from perception.records import Structured

SAME_TURN_RAD: Final = 0.14
"""Greatest angle between two parts of a wall."""
SAME_WITHIN_M: Final = 1.0
"""Distance from the other's spans within which their agreement counts: farther away lines of any wall come near."""
SAME_SLACK_M: Final = 0.025
"""Greatest distance between two walls that are one, beyond `SAME_SIGMAS`."""
SAME_SHARE: Final = 2
"""So many times more bins must agree than differ."""
EXPLAINED_SHARE: Final = 0.6
"""A wall ends when others explain this share of its bins, or fewer than `FLAT_BINS_MIN` are its own."""
EDGE_BINS: Final = 24
"""A frame moves when readings come so near its first or its last bin."""
FRAME_TURN_MAX: Final = 0.02
"""A frame turns when the line is turned against it by more than this, rad."""
HIDDEN_WITHIN_M: Final = 0.1
"""What lies this far inside another wall's ends, and `WENT_ON_M` behind it, is not heard."""


@kernel
def are_one(main: Wall, part: Wall) -> bool:
    """Return whether the covered bins of a wall lie on another, heavier one."""
    turn = main.normal_x * part.normal_y - main.normal_y * part.normal_x + main.slope - part.slope
    if abs(turn) >= SAME_TURN_RAD or main.normal_x * part.normal_x + main.normal_y * part.normal_y <= 0.0:
        return False
    same = 0
    other = 0
    for b in range(WALL_BINS):
        if not is_covered(part.bins[b]):
            continue
        u = middle_of(b)
        off = part.offset + part.slope * u
        dx = part.origin_x + part.normal_x * off - part.normal_y * u - main.origin_x
        dy = part.origin_y + part.normal_y * off + part.normal_x * u - main.origin_y
        along = main.normal_x * dy - main.normal_y * dx
        away = abs(main.offset + main.slope * along - main.normal_x * dx - main.normal_y * dy)
        sigma = math.sqrt(line_variance(main, along) + line_variance(part, u))
        if away >= SAME_SIGMAS * sigma + SAME_SLACK_M:
            other += 1
        elif is_on_span(main, along, SAME_WITHIN_M):
            same += 1
    return same > SAME_SHARE * other


@kernel
def find_same(s: StateRecord) -> int:
    """Return the first pair of walls that are one, as the heavier one's number · `MAX_WALLS` + the other's, or −1."""
    walls = s[0].room.walls
    for main in range(MAX_WALLS):
        for part in range(MAX_WALLS):
            is_lighter = 0.0 < walls[part].weight <= walls[main].weight
            if is_lighter and part != main and are_one(walls[main], walls[part]):
                return main * MAX_WALLS + part
    return -1


def move_bins(main: Wall, part: Wall) -> None:
    """Move the readings of a wall to another one, and end it."""
    source: Structured = np.asarray(part.bins)
    bins = np.flatnonzero((source["weight"] > 0.0) & (source["precision"] > 0.0))
    source = source[bins]
    off, u = source["offset_sum"] / source["precision"], (bins - HALF + 0.5) * WALL_BIN_M
    dx = part.origin_x + part.normal_x * off - part.normal_y * u - main.origin_x
    dy = part.origin_y + part.normal_y * off + part.normal_x * u - main.origin_y
    across, along = main.normal_x * dx + main.normal_y * dy, main.normal_x * dy - main.normal_y * dx
    place = np.floor(np.clip(along / WALL_BIN_M, -WALL_BINS, WALL_BINS)).astype(np.int64)
    at = place + HALF
    inside = (at >= 0) & (at < WALL_BINS)
    at, place, source, across, along = at[inside], place[inside], source[inside], across[inside], along[inside]
    across += main.slope * ((place + 0.5) * WALL_BIN_M - along)
    target: Structured = np.asarray(main.bins)
    np.add.at(target["offset_sum"], at, source["precision"] * across)
    for name in ("weight", "precision", "range_sum"):
        np.add.at(target[name], at, source[name])
    np.maximum.at(target["passes"], at, source["passes"])
    np.maximum.at(target["is_held"], at, source["is_held"])
    np.maximum.at(target["is_open"], at, source["is_open"])
    np.maximum.at(target["is_kept"], at, source["is_kept"])
    target["newest"][at] = source["newest"]
    target["number"][at] = source["number"]
    main.is_changed = 1
    free(part)


@kernel
def find_frameless(s: StateRecord, first: int) -> int:
    """Return the first wall, from `first` on, that has turned away from its frame or come near its ends, or −1."""
    for k in range(first, MAX_WALLS):
        wall = s[0].room.walls[k]
        is_turned = abs(wall.slope) > FRAME_TURN_MAX
        last = wall.spans[max(wall.span_count - 1, 0)]
        is_out = wall.spans[0].first_bin < EDGE_BINS or last.end_bin > WALL_BINS - EDGE_BINS
        if not (wall.weight > 0.0 and (is_turned or is_out)):
            continue
        low = -1
        high = -1
        for b in range(WALL_BINS):
            if wall.bins[b].weight > 0.0:
                low = b if low < 0 else low
                high = b
        if low >= 0 and (is_turned or abs((low + high + 1) // 2 - HALF) >= EDGE_BINS // 2):
            return k
    return -1


def reframe(walls: Structured, k: int) -> None:
    """Give wall `k` a frame along its line, about the middle of its readings.

    Parameters
    ----------
    walls : (MAX_WALLS + 1,) record of `Wall`
        All walls; the candidate's place is used, and free afterwards.
    k : int
        The wall, updated, to be fitted again.
    """
    wall, old = walls[k], walls[CANDIDATE]
    walls[CANDIDATE] = wall
    filled = np.flatnonzero(np.asarray(old.bins)["weight"] > 0.0)
    u = (int(filled[0] + filled[-1] + 1) // 2 - HALF) * WALL_BIN_M
    off, c = old.offset + old.slope * u, 1.0 / math.hypot(1.0, old.slope)
    nx, ny, slope = old.normal_x, old.normal_y, old.slope
    free(wall)
    wall.weight = old.weight
    wall.origin_x, wall.origin_y = old.origin_x + nx * off - ny * u, old.origin_y + ny * off + nx * u
    wall.normal_x, wall.normal_y = c * (nx + slope * ny), c * (ny - slope * nx)
    wall.offset = wall.slope = 0.0
    move_bins(wall, old)


def merge_walls(memory: Memory, p: SettingsRecord) -> None:
    """Merge walls that are one into the heaviest one; give walls that outgrow or leave their frames new ones."""
    while (pair := find_same(memory.s)) >= 0:
        walls = memory.state["room"]["walls"][0]
        move_bins(walls[pair // MAX_WALLS], walls[pair % MAX_WALLS])
        fit_walls(memory.s, p, 0, MAX_WALLS, 1)
    k = find_frameless(memory.s, 0)
    while k >= 0:
        reframe(memory.state["room"]["walls"][0], k)
        fit_walls(memory.s, p, k, k + 1, 1)
        k = find_frameless(memory.s, k + 1)


@kernel
def is_from_wall(room: WallMap, wall: Wall, q: Reading, p: SettingsRecord) -> bool:
    """Return whether a wall or an end of it explains an echo, or the echo cannot come from behind it."""
    kind, expected, along, dot = contact(wall, q, p)
    if kind == FOOT or (kind == BEAM_EDGE and edges_answer(room)):
        error = q.range_m - expected
        slack = tolerance(room, wall, along, expected, dot)
        if abs(error) < slack and is_on_span(wall, along, SPAN_MARGIN_M):
            return True
        is_certain = kind == FOOT and dot >= p[0].cos_must_answer and is_on_span(wall, along, -HIDDEN_WITHIN_M)
        if is_certain and error > slack + WENT_ON_M:
            return True
    return is_from_end(room, wall, q, p)


@kernel
def release(room: WallMap, wall: Wall, p: SettingsRecord) -> None:
    """Let the recent echoes that a wall explains start new walls.

    Parameters
    ----------
    room, wall, p
        The recent readings, updated, the wall and the settings.
    """
    for j in range(min(room.recent_count, RECENT_READINGS_MAX)):
        q = room.recent[j].reading
        kind, expected, along, dot = contact(wall, q, p)
        if kind != NOWHERE and abs(q.range_m - expected) < tolerance(room, wall, along, expected, dot):
            room.recent[j].is_free = IS_FREE


@kernel
def is_kept(wall: Wall) -> bool:
    """Return whether a wall was sure when the robot stopped."""
    is_any = False
    for b in range(WALL_BINS):
        is_any = is_any or wall.bins[b].is_kept == 1
    return is_any


@kernel
def drop_explained(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, turn: int) -> None:
    """End a wall that does not fit its readings, or whose readings heavier walls or other objects explain.

    Those are lines across a corner, or along some ends. While the robot stands, no other explanation ends what was
    sure when it stopped: that explained the same readings before.

    Parameters
    ----------
    s, tracks, p
        Memory, updated, circles and settings.
    turn : int
        Counts the calls: each looks at the next wall.
    """
    room = s[0].room
    own = -1
    for k in range(MAX_WALLS):
        if own < 0 and room.walls[(turn + k) % MAX_WALLS].weight > 0.0:
            own = (turn + k) % MAX_WALLS
    if own < 0:
        return
    if room.walls[own].misfit > WALL_MISFIT_MAX:
        release(room, room.walls[own], p)
        clear_wall(room.walls[own])
        return
    if is_kept(room.walls[own]):
        return
    count = 0
    taken = 0
    for b in range(WALL_BINS):
        of = room.walls[own].bins[b]
        if of.weight <= 0.0:
            continue
        count += 1
        # A barrel's side is a wall's until it is heard from farther round.
        is_straight = is_on_straight_span(room.walls[own], middle_of(b))
        least = ONLY_NAMED if is_straight else HIDING_PROBABILITY
        is_taken = is_from_circle(room, tracks, of.newest, p, least)
        # From afar a wall's echoes are as long as those of the corner in which it ends.
        is_taken = is_taken or (not is_straight and corner_of(room, of.newest, p) >= 0)
        for k in range(MAX_WALLS):
            is_heavier = room.walls[k].weight > room.walls[own].weight
            is_taken = is_taken or (is_heavier and is_from_wall(room, room.walls[k], of.newest, p))
        if is_taken:
            taken += 1
    if taken > EXPLAINED_SHARE * count or count - taken < FLAT_BINS_MIN:
        clear_wall(room.walls[own])
