"""The walls of a room from the readings of all sensors: one firing's work.

Each echo goes to the wall that explains it best, else to one that may continue there; what no wall, corner or end
explains may start a new wall. Ranges that pass through a wall weaken it where they do, so that doorways stay open.
These walls are for the report, and withdraw the names of round objects that they explain; they take no echoes from
round objects, which compete with a line of their own on the same readings.

Kernels that call one another are compiled again with each caller, so Python calls them here one after another. What
is rare is in numpy.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, Memory, StateRecord
from perception.bayes.memory.wall_records import (
    CORNERS_MAX,
    EDGES_MAX,
    GOLDEN_RATIO,
    IS_FREE,
    IS_KNOWN,
    MAX_WALLS,
    RECENT_READINGS_MAX,
    WALL_BINS,
    RoomCorner,
    WallMap,
)
from perception.bayes.walls.bins import PASSES_KEPT, SILENT_PASS, bin_of, enter_pass, enter_reading
from perception.bayes.walls.contact import (
    BEAM_EDGE,
    END_MARGIN_M,
    EXPLAINED_SIGMAS,
    FIRM_WEIGHT,
    FOOT,
    NOWHERE,
    ONLY_NAMED,
    WENT_ON_M,
    contact,
    distance_and_foot,
    edges_answer,
    explaining_wall,
    is_from_circle,
    is_from_end,
    is_hidden,
    is_on_span,
    is_on_straight_span,
    range_sigma,
    tolerance,
    wall_point,
)
from perception.bayes.walls.corners import enter_echo, enter_looks, find_corners, point_of
from perception.bayes.walls.fit import GAP_MAX_M, fit_walls
from perception.bayes.walls.initiation import try_wall
from perception.bayes.walls.merging import drop_explained, merge_walls
from perception.bayes.walls.noise import add_residual, estimate_noise
from perception.bayes.walls.points import LONGER_SIGMAS, find_heard_points
from perception.bayes.walls.review import RECENT_SPACING_M, remember, review
from perception.kernel import entry_kernel, kernel
from perception.shared_numbers import FAR

KNOWN_SPACING_M: Final = 0.24
"""Least distance between the recent readings of a sensor that something explains; see `RECENT_SPACING_M`."""
FIT_FIRINGS: Final = 2
"""Each wall is fitted again at every second firing."""
TIDY_FIRINGS: Final = 8
"""Firings between two passes over pairs of walls, and between two looks for what is heard on a wall's line."""
REVIEW_FIRINGS: Final = 4
"""Firings between two reviews of a wall: a tenth of a millisecond each."""
BEAM_WALL_WEIGHT_MIN: Final = 40.0
"""Walls of this weight show whether slanting walls answer from the beam's edge."""
THIN_M: Final = 0.2
"""Echoes of round objects thinner than this start no wall and extend none."""
LOUD_SHARE: Final = 1.2
"""Slanting walls are taken to answer where beams are silent less often than so many times the share that asks for
care with names, until walls are known that show it. Between drums a fifth of the beams is silent, or more; in rooms
of walls that answer at any angle a seventh at most."""
LOUD_SILENCES_MIN: Final = 16.0
"""So many silences must be expected before that: wide beams hear mirrors, too."""
EDGES_COUNTED_MAX: Final = 400.0
"""Greatest count of edge echoes and silences; then both are halved."""


@kernel
def weaken(room: WallMap, tracks: CircleTracks, q: Reading, own: int, p: SettingsRecord) -> None:
    """Weaken the walls that a reading passed through, and count whether slanting walls answer.

    Parameters
    ----------
    room, tracks, q, p
        The walls, updated, the circles, what lies behind which is not seen, the reading and the settings.
    own : int
        The wall that explains it, −1 if none does.
    """
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight <= 0.0:
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind == NOWHERE or (kind == FOOT and k == own):
            continue
        e = q.range_m - expected
        slack = tolerance(room, wall, along, expected, dot)
        if kind == BEAM_EDGE:
            is_free = own < 0 or k == own
            if wall.weight > BEAM_WALL_WEIGHT_MIN and is_free and is_on_span(wall, along, -END_MARGIN_M):
                if abs(e) < slack:
                    room.edge_echoes += 1.0
                elif e > slack + WENT_ON_M:
                    room.edge_silences += 1.0
        elif dot >= p[0].cos_must_answer and e > slack:
            b = bin_of(along)
            if 0 <= b < WALL_BINS:
                x, y = wall_point(wall, along)
                if is_hidden(tracks, q, x, y):
                    # All looks at this place are along its normal: earlier ones were as blind.
                    wall.bins[b].passes *= PASSES_KEPT
                else:
                    enter_pass(wall, b, 1.0 if q.range_m < FAR else SILENT_PASS)
                if is_on_span(wall, along, 0.0):
                    wall.is_changed = 1
    if room.edge_echoes + room.edge_silences > EDGES_COUNTED_MAX:
        room.edge_echoes *= 0.5
        room.edge_silences *= 0.5


@kernel
def may_be_of_wall(room: WallMap, edge: RoomCorner, q: Reading) -> bool:
    """Return whether the wall that ends at an edge may answer an echo from afar itself, where it goes on.

    Between mirrors an end with many such echoes would seem to be an inside corner, in the middle of a plain wall.
    """
    d = math.hypot(edge.x - q.x, edge.y - q.y)
    if d <= EDGE_REACH_M or edges_answer(room):
        return False
    distance, _ = distance_and_foot(room.walls[edge.first], q.x, q.y)
    return d - abs(distance) <= LONGER_SIGMAS * range_sigma(room, d)


@kernel
def enter_point(room: WallMap, q: Reading, p: SettingsRecord, less_than: float) -> float:
    """Enter an echo that a corner or an edge explains with less error than this; return its error, else 1."""
    corner, error = point_of(room, room.corners, CORNERS_MAX, q, p)
    edge, error_of_edge = point_of(room, room.edges, EDGES_MAX, q, p)
    if min(error, error_of_edge) >= less_than:
        return 1.0
    if error <= error_of_edge:
        enter_echo(room, room.corners[corner], q)
    elif not may_be_of_wall(room, room.edges[edge], q):
        enter_echo(room, room.edges[edge], q)
    return min(error, error_of_edge)


@kernel
def is_from_any_end(room: WallMap, q: Reading, p: SettingsRecord) -> bool:
    """Return whether the end of a wall explains an echo."""
    is_from_any = False
    for k in range(MAX_WALLS):
        is_known = room.walls[k].weight >= FIRM_WEIGHT
        is_from_any = is_from_any or (is_known and is_from_end(room, room.walls[k], q, p))
    return is_from_any


@kernel
def keep_recent(room: WallMap, sensor: int, q: Reading, is_free: int) -> int:
    """Remember a reading if its sensor has moved far enough; return its place, or −1.

    Parameters
    ----------
    room, sensor, q
        The memory, updated, the sensor and its reading.
    is_free : int
        As in `RecentReading`.
    """
    is_first = room.kept[sensor] == 0.0
    spacing = RECENT_SPACING_M if is_free == IS_FREE else KNOWN_SPACING_M
    if not is_first and math.hypot(q.x - room.kept_x[sensor], q.y - room.kept_y[sensor]) <= spacing:
        return -1
    room.kept[sensor] = 1.0
    room.kept_x[sensor] = q.x
    room.kept_y[sensor] = q.y
    slot = room.recent_count % RECENT_READINGS_MAX
    copy_reading(q, room.recent[slot].reading)
    room.recent[slot].is_free = is_free
    room.recent_count += 1
    return slot


@kernel
def is_from_named(room: WallMap, tracks: CircleTracks, of: int, q: Reading, p: SettingsRecord) -> bool:
    """Return whether an echo, which `of` explains (see `Scratch.explained_by`), is one of a named object."""
    if of >= len(tracks) or (of >= 0 and tracks[of].is_named == 1):
        return True
    return is_from_circle(room, tracks, q, p, ONLY_NAMED)


@kernel
def explain(room: WallMap, q: Reading, p: SettingsRecord, is_known: bool) -> tuple[int, int, bool]:
    """Return the wall that explains an echo (−1: none), its kind of echo, and whether a point of walls does.

    An echo that is known already, as that of an object, makes no wall longer. A wall either ends or goes on: that is
    taken which explains the echo better, and an echo of the end passed where the wall would have been.
    """
    own, kind, error = explaining_wall(room, q, p, 0.0)
    if own >= 0 and is_known and not is_on_straight_span(room.walls[own], contact(room.walls[own], q, p)[2]):
        own = -1
    if own >= 0:
        return own, kind, False
    if not is_known:
        own, kind, error = explaining_wall(room, q, p, GAP_MAX_M)
    error_of_point = enter_point(room, q, p, error)
    is_point = error_of_point < 1.0
    if not is_point:
        return own, kind, False
    if own >= 0:
        lead = 0.5 * EXPLAINED_SIGMAS**2 * (error**2 - error_of_point**2)
        b = bin_of(contact(room.walls[own], q, p)[2])
        if 0 <= b < WALL_BINS:
            enter_pass(room.walls[own], b, min(lead, 1.0))
    return -1, kind, True


@entry_kernel
def enter_firing(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int) -> int:
    """Enter a firing's readings; return the place of a recent echo that nothing explains, or −1.

    Parameters
    ----------
    s, tracks, p
        Memory, updated, circles and settings; echoes that a named object explains support no wall.
    m : int
        Readings of this firing.
    """
    room = s[0].room
    scratch = s[0].scratch
    estimate_noise(s, p)
    allowed = p[0].silent_share_min * (s[0].heard + s[0].silent)
    room.is_loud = 1 if allowed >= LOUD_SILENCES_MIN and s[0].silent < LOUD_SHARE * allowed else 0
    newest = -1
    unexplained = 0
    for i in range(m):
        q = scratch.fired[i]
        of = scratch.explained_by[i]
        is_named = is_from_named(room, tracks, of, q, p)
        # A wall's side and a large round object are alike until the object is named.
        is_known = is_named or q.range_m >= FAR or (of >= 0 and tracks[of].radius < THIN_M)
        own = -1
        is_point = False
        if q.range_m < FAR and not is_named:
            own, kind, is_point = explain(room, q, p, is_known)
            if own >= 0:
                if kind == FOOT:
                    expected, along = distance_and_foot(room.walls[own], q.x, q.y)
                    add_residual(room, room.walls[own], q.range_m - expected, along, expected)
                enter_reading(room, room.walls[own], q, kind, p)
        remember(room, scratch.fired_sensors[i], q)
        weaken(room, tracks, q, own, p)
        enter_looks(room, tracks, room.corners, CORNERS_MAX, q, p)
        enter_looks(room, tracks, room.edges, EDGES_MAX, q, p)
        is_known = is_known or own >= 0 or is_point or is_from_any_end(room, q, p)
        # The echoes of a wall that may be another one may also start that.
        is_open = own >= 0 and not is_on_straight_span(room.walls[own], contact(room.walls[own], q, p)[2])
        slot = keep_recent(room, scratch.fired_sensors[i], q, IS_KNOWN if is_known and not is_open else IS_FREE)
        if slot >= 0 and not is_known:
            unexplained += 1
            # Any of them with equal chance: else the echoes of one corner keep the others waiting.
            if room.recent_count * GOLDEN_RATIO % 1.0 * unexplained < 1.0:
                newest = slot
    room.firings += 1
    return newest


def update_walls(memory: Memory, p: SettingsRecord, m: int) -> None:
    """Update the walls by the `m` readings of the firing that `observe` has processed."""
    newest = enter_firing(memory.s, memory.tracks, p, m)
    firings: int = memory.firings.item()
    fit_walls(memory.s, p, firings % FIT_FIRINGS, MAX_WALLS, FIT_FIRINGS)
    is_new = newest >= 0 and try_wall(memory, p, newest)
    turn, phase = divmod(firings, TIDY_FIRINGS)
    if phase == 0 or is_new:
        merge_walls(memory, p)
    if phase == TIDY_FIRINGS // 3:
        drop_explained(memory.s, memory.tracks, p, turn)
    elif phase == TIDY_FIRINGS * 2 // 3:
        find_corners(memory.s)
    elif phase == TIDY_FIRINGS - 1:
        find_heard_points(memory, p, turn)
    if phase % REVIEW_FIRINGS == 1:
        review(memory.s, memory.tracks, p, firings // REVIEW_FIRINGS)
