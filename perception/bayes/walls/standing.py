"""What is sure when a robot stops stays sure while it stands: more readings of an unchanged room take nothing away.

Whether a wall is reported, and how far it goes, is decided by limits. The last readings of a drive, and the work on
walls that follows them, take what is near a limit across it, although no echo contradicts it. So what is sure is
marked when the robot stops, and held until it moves on; only ranges that pass through, or a line that no longer fits
its readings, take it away.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.angles import wrapped
from perception.bayes.inference.placement import COORDINATE_MAX_M, STANDING_M
from perception.bayes.memory.parameters import STILL_COS
from perception.bayes.memory.state import Memory, StateRecord
from perception.bayes.memory.wall_records import CORNERS_MAX, EDGES_MAX, WALL_BIN_M, WALL_BINS
from perception.bayes.walls.bins import HALF
from perception.bayes.walls.corners import SAME_CORNER_M
from perception.bayes.walls.report import sure_room
from perception.kernel import entry_kernel
from perception.sensor_mounts import RingPose

STANDING_RAD: Final = math.acos(STILL_COS)
STOPPED_M: Final = 0.001
"""A robot that moved by less than this between two firings, and turned by less than `STOPPED_RAD`, has stopped: bases
count their way in millimetres. Later it stands while its sensors are where they were, as `placement` has it."""
STOPPED_RAD: Final = 0.001
"""Turn in `STOPPED_M`."""


def keep_while_standing(memory: Memory, pose: RingPose) -> None:
    """Mark what is sure when the robot stops, and remove the marks when it moves on.

    Parameters
    ----------
    memory : Memory
        Updated.
    pose : RingPose
        Of a firing whose readings are not in the memory yet.
    """
    if has_just_stopped(memory.s, pose):
        mark_sure(memory)


@entry_kernel
def has_just_stopped(s: StateRecord, pose: RingPose) -> bool:
    """Return whether the robot has stopped since the last firing; when it moves on, remove the marks.

    Parameters
    ----------
    s : (1,) State
        Updated.
    pose : RingPose
        As of `keep_while_standing`.
    """
    x, y, yaw = pose
    if not (abs(x) < COORDINATE_MAX_M and abs(y) < COORDINATE_MAX_M and math.isfinite(yaw)):
        return False
    room = s[0].room
    stop = room.stop
    moved, turned = math.hypot(x - stop.x, y - stop.y), abs(wrapped(yaw - stop.yaw))
    is_standing = stop.is_standing == 1
    most_m, most_rad = (STANDING_M, STANDING_RAD) if is_standing else (STOPPED_M, STOPPED_RAD)
    if moved <= most_m and turned <= most_rad:
        stop.is_standing = 1
        return not is_standing
    if is_standing:
        for k in range(len(room.walls)):
            for b in range(WALL_BINS):
                room.walls[k].bins[b].is_kept = 0
        for k in range(CORNERS_MAX):
            room.corners[k].is_kept = 0
        for k in range(EDGES_MAX):
            room.edges[k].is_kept = 0
    stop.x, stop.y, stop.yaw, stop.is_standing = x, y, yaw, 0
    return False


def mark_sure(memory: Memory) -> None:
    """Mark the places of the walls that are sure, and the corners."""
    room = memory.state["room"][0]
    walls, found = sure_room(memory)
    bins = room["walls"]["bins"]
    for number, of in walls.items():
        for first, end in (np.rint(of.ends / WALL_BIN_M).astype(np.int64) + HALF).tolist():
            bins["is_kept"][number, max(first, 0) : min(end, WALL_BINS)] = 1
    for x, y, *_ in found:
        for points in (room["corners"], room["edges"]):
            is_there = np.hypot(points["x"] - x, points["y"] - y) < SAME_CORNER_M
            points["is_kept"][is_there & (points["is_used"] == 1)] = 1
