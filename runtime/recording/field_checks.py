"""Checks of the values that a recording holds, so that a damaged or hostile one does no harm.

A recording is written by this program and read by anyone. The types of its fields are checked by pydantic; the checks
here are for what a type does not say: times and places that arithmetic can bear, and sizes that belong together.
Every check raises a ValueError that names the value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Final

import numpy as np

from behaviors.leave_canyon import Detour
from behaviors.valley.polar_histogram import SECTORS
from drivers.messages import CrossPaths, Firing, Floats, Odometry, Pose, Twist
from runtime.cycle.clock_monitor import ClockMonitor
from runtime.cycle.drive_requests import validate
from runtime.cycle.goal_drive import GoalDrive
from runtime.cycle.modes import ModeState
from runtime.cycle.motion_monitor import DIRECTIONS, MotionMonitor
from runtime.cycle.stalled_drives import DriveMemory
from runtime.cycle.step import CycleRecord
from runtime.cycle.summary import ObjectRow

TIME_MAX_S: Final = 1e9
"""Greatest time, s: thirty years."""
PLACE_MAX_M: Final = 1e6
"""Greatest coordinate, m; also the greatest unwrapped angle, rad."""
RANGE_MAX_M: Final = 1e3
"""Greatest range, m; a sensor listens up to 100 m at most."""
SPEED_MAX: Final = 1e6
"""Greatest velocity, m/s and rad/s."""
COUNT_MAX: Final = 2**53
"""Greatest count or number; a float still holds it exactly."""
PIECE_DELAY_MAX_US: Final = 10**15

_OBJECT_TEXT: Final = ("model",)
_OBJECT_COUNT: Final = ("support",)
_OPTIONAL: Final = ("probability", "covariance", "number")
_COVARIANCE: Final = 3


def _bounded(what: str, value: float, most: float) -> None:
    if not -most <= value <= most:  # also refuses NaN
        raise ValueError(f"{what} is {value!r:.40}, expected a number within ±{most:g}")


def _time(what: str, value: float | None) -> None:
    if value is not None:
        _bounded(what, value, TIME_MAX_S)


def _count(what: str, value: int) -> None:
    if not 0 <= value <= COUNT_MAX:
        raise ValueError(f"{what} is {value!r:.40}, expected a count")


def _pose(what: str, pose: Pose) -> None:
    for name, value in (("x", pose.x), ("y", pose.y), ("theta", pose.theta)):
        _bounded(f"{what}.{name}", value, PLACE_MAX_M)


def _ranges(what: str, ranges: Floats) -> None:
    heard = ranges[~np.isnan(ranges) & (ranges != math.inf)]
    if len(heard) and not (heard.min() >= 0.0 and heard.max() <= RANGE_MAX_M):
        raise ValueError(f"{what} has a range of {heard.min():g} or {heard.max():g} m, expected 0 to {RANGE_MAX_M:g}")


def _firing(what: str, firing: Firing) -> None:
    _time(f"{what}.robot_s", firing.robot_s)
    _pose(f"{what}.pose", firing.pose)
    _bounded(f"{what}.ring_yaw", firing.ring_yaw, PLACE_MAX_M)
    _ranges(f"{what}.ranges_m", firing.ranges_m)
    if firing.cross_paths is not None:
        check_cross_paths(f"{what}.cross_paths", firing.cross_paths, len(firing.ranges_m))


def check_cross_paths(what: str, heard: CrossPaths, sensors: int) -> None:
    """Check that cross paths name sensors of a ring, and that there is a distance for each.

    Raises
    ------
    ValueError
        They do not belong to a ring of so many sensors, or a distance is impossible.
    """
    lengths = [len(heard.transmitters), len(heard.listeners), len(heard.half_paths_m)]
    if not 1 <= lengths[0] <= sensors or len(set(lengths)) > 1:
        raise ValueError(f"{what} has arrays of {lengths} entries, expected 1 to {sensors} in each")
    highest = int(max(heard.transmitters.max(), heard.listeners.max()))
    if highest >= sensors or (heard.transmitters == heard.listeners).any():
        raise ValueError(f"{what} names sensor {highest} of {sensors}, or one that hears itself")
    if np.isnan(heard.half_paths_m).any():
        raise ValueError(f"{what} has a path that is no number")
    _ranges(f"{what}.half_paths_m", heard.half_paths_m)


def _odometry(what: str, odometry: Odometry | None) -> None:
    if odometry is None:
        return
    _time(f"{what}.robot_s", odometry.robot_s)
    _pose(f"{what}.pose", odometry.pose)
    _bounded(f"{what}.ring_yaw", odometry.ring_yaw, PLACE_MAX_M)
    _twist(f"{what}.twist", odometry.twist)
    _bounded(f"{what}.last_drive_seq", odometry.last_drive_seq, COUNT_MAX)
    _count(f"{what}.flags", odometry.flags)


def _twist(what: str, twist: Twist) -> None:
    _bounded(f"{what}.v", twist.v, SPEED_MAX)
    _bounded(f"{what}.w", twist.w, SPEED_MAX)


def _motion(what: str, monitor: MotionMonitor) -> None:
    _odometry(f"{what}.odometry", monitor.odometry)
    for command in monitor.commands:
        _time(f"{what}.commands.run_s", command.run_s)
        _twist(f"{what}.commands.twist", command.twist)
    for direction in monitor.directions:
        _bounded(f"{what}.directions.explained", direction.explained, SPEED_MAX)
        _bounded(f"{what}.directions.excess", direction.excess, PLACE_MAX_M)
    if len(monitor.directions) not in {0, DIRECTIONS} or (monitor.odometry is None) != (not monitor.directions):
        raise ValueError(f"{what} has {len(monitor.directions)} directions, expected {DIRECTIONS} beside odometry")
    if monitor.still is not None:
        _pose(f"{what}.still", monitor.still)
    _time(f"{what}.still_s", monitor.still_s)
    _time(f"{what}.asked_s", monitor.asked_s)
    _time(f"{what}.asked_turn_s", monitor.asked_turn_s)
    _bounded(f"{what}.asked.along", monitor.asked.along, PLACE_MAX_M)
    _bounded(f"{what}.asked.turned", monitor.asked.turned, PLACE_MAX_M)
    _twist(f"{what}.modelled", monitor.modelled)
    _time(f"{what}.modelled_run_s", monitor.modelled_run_s)


def _detour(what: str, detour: Detour) -> None:
    for row in detour.near:
        for value in row:
            _bounded(f"{what}.near", value, PLACE_MAX_M)
    for part in (detour, detour.ahead, detour.block):
        for field in () if part is None else fields(part):
            value = getattr(part, field.name)
            if isinstance(value, float):
                _bounded(f"{what}.{field.name}", value, PLACE_MAX_M)


def check_mode(mode: ModeState) -> None:
    """Check the times of a mode."""
    _time("mode.entered_run_s", mode.entered_run_s)
    _time("mode.arming_run_s", mode.arming_run_s)


def check_cycle(record: CycleRecord) -> None:
    """Check the times, poses, ranges and counts of a cycle.

    Drive requests and edits may hold any number: the cycle itself validates and refuses them.
    """
    inputs, received = record.inputs, record.inputs.received
    for name, time_s in (
        ("run_s", inputs.run_s), ("host_s", inputs.host_s), ("echo_age_s", inputs.echo_age_s),
        ("gap_max_s", inputs.gap_max_s),
    ):  # fmt: skip
        _time(f"inputs.{name}", time_s)
    for k, firing in enumerate(received.firings):
        _firing(f"inputs.received.firings.{k}", firing)
    _odometry("inputs.received.odometry", received.odometry)
    _count("inputs.received.flags", received.flags)
    check_mode(record.mode)
    if isinstance(record.command, Twist):
        _twist("command", record.command)
    for name, count in (
        ("cycle", record.cycle), ("new_segments", record.new_segments), ("segments", record.segments),
        ("clusters", record.clusters), ("quanta", record.quanta), ("iterations", record.iterations),
    ):  # fmt: skip
        _count(name, count)


def check_state(state: Mapping[str, Any]) -> None:
    """Check a state without perception: the fields of `runtime.cycle.step.State`, by name.

    Raises
    ------
    ValueError
        A value is none that a run can have.
    """
    for name in ("run_s", "last_firing_robot_s", "requested_run_s"):
        _time(f"state.{name}", state[name])
    check_mode(state["mode"])
    _odometry("state.odometry", state["odometry"])
    _count("state.cycle", state["cycle"])
    if state["leg"] is not None:
        _bounded("state.leg.origin_x", state["leg"].origin_x, PLACE_MAX_M)
        _bounded("state.leg.origin_y", state["leg"].origin_y, PLACE_MAX_M)
    if state["goal_place"] is not None:
        _bounded("state.goal_place.x", state["goal_place"].x, PLACE_MAX_M)
        _bounded("state.goal_place.y", state["goal_place"].y, PLACE_MAX_M)
    if state["goal_drive"] is not None:
        _goal_drive("state.goal_drive", state["goal_drive"])
    for place in state["trail"]:
        for value in place:
            _bounded("state.trail", value, PLACE_MAX_M)
    if (problem := validate(state["drive_request"])) is not None:
        raise ValueError(f"state.drive_request: {problem}")
    _memory("state.drive_memory", state["drive_memory"])
    _motion("state.motion_monitor", state["motion_monitor"])
    _clock("state.clock_monitor", state["clock_monitor"])
    for response in state["vectors"]:
        _bounded("state.vectors.x", response.x, PLACE_MAX_M)
        _bounded("state.vectors.y", response.y, PLACE_MAX_M)


def _memory(what: str, memory: DriveMemory) -> None:
    commitment, progress = memory.commitment, memory.progress
    _time(f"{what}.commitment.started_run_s", commitment.started_run_s)
    _time(f"{what}.commitment.turned_run_s", commitment.turned_run_s)
    _bounded(f"{what}.commitment.requested", commitment.requested, 1.0)
    _bounded(f"{what}.commitment.side", commitment.side, 1.0)
    _bounded(f"{what}.commitment.turn_rad_s", commitment.turn_rad_s, SPEED_MAX)
    _time(f"{what}.progress.run_s", progress.run_s)
    _bounded(f"{what}.progress.best_m", progress.best_m or 0.0, PLACE_MAX_M)


def _clock(what: str, monitor: ClockMonitor) -> None:
    _count(f"{what}.repeats", monitor.repeats)
    for name, reading in (("newest", monitor.newest), ("late", monitor.late)):
        if reading is not None:
            _time(f"{what}.{name}.robot_s", reading.robot_s)
            _time(f"{what}.{name}.run_s", reading.run_s)
    for name, lead in (("lead", monitor.lead), ("heard", monitor.heard)):
        if lead is not None:
            for time_s in (lead.begin_run_s, lead.newest_s, *lead.before_s):
                _time(f"{what}.{name}", time_s)


def _goal_drive(what: str, drive: GoalDrive) -> None:
    """Check the drive to a goal: its places, times and costs, and the numbers by which places name one another."""
    progress, valley, search = drive.progress, drive.valley, drive.search
    for name, time_s in (
        ("progress.moved_run_s", progress.moved_run_s), ("progress.nearer_run_s", progress.nearer_run_s),
        ("progress.excused_run_s", progress.excused_run_s),
        ("searched_run_s", drive.searched_run_s),
    ):  # fmt: skip
        _time(f"{what}.{name}", time_s)
    nodes = [value for node in search.nodes for value in (node.x, node.y, node.direction, node.cost_m)]
    places = [value for place in (*search.way, *search.closed, *search.failed) for value in place]
    for value in (
        progress.x, progress.y, progress.nearest_m, valley.direction_rad or 0.0, *(search.goal or ()), *nodes,
        *places, *(cost for cost, _ in search.waiting), *(value for square in search.passed for value in square),
    ):  # fmt: skip
        _bounded(f"{what}'s number", value, PLACE_MAX_M)
    _detour(f"{what}.detour", drive.detour)
    if len(valley.blocked) != SECTORS or valley.blocked.strip("01"):
        raise ValueError(f"{what}.valley.blocked: expected {SECTORS} digits 0 or 1")
    if any(not -1 <= node.parent < k for k, node in enumerate(search.nodes)):
        raise ValueError(f"{what}.search: a node whose parent does not come before it")
    if any(not 0 <= number < len(search.nodes) for _, number in search.waiting):
        raise ValueError(f"{what}.search: a number of no node")


def check_pieces(after_us: Sequence[int], sizes: Sequence[int], data: str) -> None:
    """Check that the pieces of serial data have a time each and fill the data exactly.

    Parameters
    ----------
    after_us : list of int
        Delay of each piece after the first one, µs.
    sizes : list of int
        Number of bytes in each piece.
    data : str
        All pieces in hexadecimal.

    Raises
    ------
    ValueError
        They do not add up.
    """
    if len(after_us) != len(sizes):
        raise ValueError(f"{len(sizes)} pieces of data with {len(after_us)} times")
    if any(size < 0 for size in sizes) or 2 * sum(sizes) != len(data):
        raise ValueError(f"pieces of {sum(sizes)} bytes together, and {len(data)} hexadecimal digits of data")
    if any(abs(after) > PIECE_DELAY_MAX_US for after in after_us):
        raise ValueError(f"a piece of data more than {1e-6 * PIECE_DELAY_MAX_US:g} s after the first one")
    bytes.fromhex(data)


def check_segments(added: Sequence[Sequence[float]]) -> None:
    """Check the ends and normals of outline segments."""
    for row in added:
        for value in row:
            _bounded("a segment's coordinate or direction", value, PLACE_MAX_M)


def check_object(row: Mapping[str, Any]) -> None:
    """Check one object of a list: the fields of `runtime.cycle.summary.ObjectRow`, finite.

    Fields beyond those are numbers, flags or texts.

    Raises
    ------
    ValueError
        A field is missing, or has another type than in `ObjectRow`.
    """
    if missing := sorted(ObjectRow.__annotations__.keys() - {*_OPTIONAL, *row}):
        raise ValueError(f"an object without {missing[0]}")
    for name, value in row.items():
        if name in _OBJECT_TEXT:
            is_valid = isinstance(value, str)
        elif name in _OBJECT_COUNT:
            is_valid = type(value) is int and 0 <= value <= COUNT_MAX
        elif name == "number":
            is_valid = value is None or (type(value) is int and 0 <= value <= COUNT_MAX)
        elif name == "covariance":
            is_valid = isinstance(value, list) and len(value) == _COVARIANCE and all(map(_is_finite, value))
        elif name in ObjectRow.__annotations__:
            is_valid = _is_finite(value)
        else:
            is_valid = value is None or isinstance(value, str | bool) or _is_finite(value)
        if not is_valid:
            raise ValueError(f"an object whose {name:.40} is {value!r:.40}")


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) <= COUNT_MAX
