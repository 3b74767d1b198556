"""The walls of a room from the readings of all sensors: one firing's work.

Each echo goes to the wall that explains it best, else to one that may continue there; what no wall, corner or end
explains may start a new wall. Ranges that pass through a wall weaken it where they do, so that doorways stay open.
These walls are for the report; recognition has lines of its own (`perception.bayes.walls`), which take their echoes
from false round objects before they are certain.

Kernels that call one another are compiled again with each caller, so Python calls them here one after another. What
is rare is in numpy.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.elements import Reading
from perception.bayes.noise_estimation import noise_variance
from perception.bayes.range_fit import FAR
from perception.bayes.reservoir import copy_reading
from perception.bayes.settings_record import SettingsRecord
from perception.bayes.state import CircleTracks, Memory, StateRecord
from perception.bayes.wall_bins import SILENT_PASS, bin_of, enter_pass, enter_reading
from perception.bayes.wall_contact import (
    BEAM_EDGE,
    CORNER_SLACK_M,
    EXPLAINED_SIGMAS,
    NOWHERE,
    contact,
    corner_of,
    explaining_wall,
    is_from_circle,
    is_from_end,
    is_on_span,
    range_sigma,
    tolerance,
)
from perception.bayes.wall_corners import find_corners
from perception.bayes.wall_fit import fit_walls
from perception.bayes.wall_initiation import try_wall
from perception.bayes.wall_merging import drop_explained, merge_walls
from perception.bayes.wall_records import (
    CORNERS_MAX,
    GOLDEN_RATIO,
    IS_FREE,
    IS_KNOWN,
    MAX_WALLS,
    RECENT_MAX,
    WALL_BINS,
    WallMap,
)
from perception.kernel import kernel

GROWTH_M: Final = 0.75
"""A wall may continue this far beyond its spans."""
RECENT_SPACING_M: Final = 0.08
"""Least distance between the recent readings of a sensor."""
FIT_FIRINGS: Final = 2
"""Each wall is fitted again at every second firing."""
TIDY_FIRINGS: Final = 8
"""Firings between two passes over pairs of walls."""
EDGE_WALL_WEIGHT_MIN: Final = 40.0
EDGE_WITHIN_M: Final = 0.15
"""Walls of this weight show, this far inside their ends, whether slanting walls answer from the beam's edge."""
EDGE_SLACK_M: Final = 0.05
EDGES_COUNTED_MAX: Final = 400.0
"""Greatest count of edge echoes and silences; then both are halved."""
CORNER_PASS_SLACK_M: Final = 0.1
"""A range this much longer than to a corner passed it."""


@kernel
def weaken(room: WallMap, q: Reading, own: int, p: SettingsRecord) -> None:
    """Weaken the walls that a reading passed through, and count whether slanting walls answer.

    Parameters
    ----------
    room, q, p
        The walls, updated, the reading and the settings.
    own : int
        The wall that explains it, −1 if none does.
    """
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight <= 0.0 or k == own:
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind == NOWHERE:
            continue
        e = q.range_m - expected
        slack = tolerance(room, wall, along, expected)
        if kind == BEAM_EDGE:
            if wall.weight > EDGE_WALL_WEIGHT_MIN and own < 0 and is_on_span(wall, along, -EDGE_WITHIN_M):
                if abs(e) < slack:
                    room.edge_echoes += 1.0
                elif e > slack + EDGE_SLACK_M:
                    room.edge_silences += 1.0
        elif dot >= p[0].cos_must_answer and e > slack:
            b = bin_of(along)
            if 0 <= b < WALL_BINS:
                enter_pass(wall, b, 1.0 if q.range_m < FAR else SILENT_PASS)
                if is_on_span(wall, along, 0.0):
                    wall.is_changed = 1
    if room.edge_echoes + room.edge_silences > EDGES_COUNTED_MAX:
        room.edge_echoes *= 0.5
        room.edge_silences *= 0.5


@kernel
def enter_corners(room: WallMap, q: Reading, p: SettingsRecord) -> None:
    """Count a reading for or against the corners towards which it looked."""
    for c in range(CORNERS_MAX):
        corner = room.corners[c]
        if corner.is_used == 0:
            continue
        dx = corner.x - q.x
        dy = corner.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        if dx * q.axis_x + dy * q.axis_y < p[0].cos_must_answer * d:
            continue
        if q.range_m > d + EXPLAINED_SIGMAS * range_sigma(room, d) + CORNER_PASS_SLACK_M + CORNER_SLACK_M:
            corner.passes += 1.0
        else:
            corner.ended += 1.0


@kernel
def is_explained_by_point(room: WallMap, q: Reading, p: SettingsRecord) -> bool:
    """Return whether a corner or the end of a wall explains an echo; count it for the corner."""
    corner = corner_of(room, q, p)
    if corner >= 0:
        room.corners[corner].echoes += 1.0
        return True
    is_from_any = False
    for k in range(MAX_WALLS):
        is_from_any = is_from_any or is_from_end(room, room.walls[k], q, p)
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
    if not is_first and math.hypot(q.x - room.kept_x[sensor], q.y - room.kept_y[sensor]) <= RECENT_SPACING_M:
        return -1
    room.kept[sensor] = 1.0
    room.kept_x[sensor] = q.x
    room.kept_y[sensor] = q.y
    slot = room.recent_count % RECENT_MAX
    copy_reading(q, room.recent[slot].reading)
    room.recent[slot].is_free = is_free
    room.recent_count += 1
    return slot


@kernel
def enter_firing(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int) -> int:
    """Enter a firing's readings; return the place of a recent echo that nothing explains, or −1.

    Parameters
    ----------
    s, tracks, p
        Memory, updated, circles and settings; echoes that an established object explains support no wall.
    m : int
        Readings of this firing.
    """
    room = s[0].room
    scratch = s[0].scratch
    room.variance_m2, room.relative_variance = noise_variance(s, p)
    newest = -1
    unexplained = 0
    for i in range(m):
        q = scratch.fired[i]
        is_known = q.range_m >= FAR or scratch.explained_by[i] >= 0 or is_from_circle(room, tracks, q, p)
        own = -1
        if not is_known:
            own, kind = explaining_wall(room, q, p, GROWTH_M)
            if own >= 0:
                enter_reading(room.walls[own], q, kind, p)
        weaken(room, q, own, p)
        enter_corners(room, q, p)
        is_known = is_known or own >= 0 or is_explained_by_point(room, q, p)
        slot = keep_recent(room, scratch.fired_sensors[i], q, IS_KNOWN if is_known else IS_FREE)
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
    firings = int(memory.state["room"]["firings"][0])
    fit_walls(memory.s, p, firings % FIT_FIRINGS, MAX_WALLS, FIT_FIRINGS)
    if newest >= 0:
        try_wall(memory, p, newest)
    turn, phase = divmod(firings, TIDY_FIRINGS)
    if phase == 0:
        merge_walls(memory, p)
    elif phase == TIDY_FIRINGS // 3:
        drop_explained(memory.s, memory.tracks, p, turn)
    elif phase == TIDY_FIRINGS * 2 // 3:
        find_corners(memory.s)
