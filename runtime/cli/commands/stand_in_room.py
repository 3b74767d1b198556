"""`echolocate stand --map`: where in a known room one stand of the ring was heard, from an unknown start."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_world
from drivers.messages import Pose, wrap_angle
from runtime.cli.commands.offline_io import plain_console
from runtime.cli.commands.stand import read_stand
from runtime.cycle.summary import write_json
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.support.length_format import Units, format_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.messages import Firing


def locate_stand(
    file: str,
    map_file: str,
    at_s: float | None,
    *,
    robot: str | None,
    json_file: str | None,
    force: bool,
    units: Units,
    options: RingLogOptions = AUTO,
) -> int:
    """Print where in a known room a robot may have stood, and return the exit code.

    Parameters
    ----------
    file, map_file, at_s, robot, json_file, force, units, options
        As of `runtime.cli.commands.stand.stand`.

    Raises
    ------
    UserError
        A file cannot be read or written, the map has no surface, or no place in it fits what was heard.
    """
    from perception.localization.drumheller.localize import localize
    from perception.localization.room.expected_ranges import reflection_of
    from perception.localization.room.room import room_of
    from perception.stand import last_round

    world = load_world(map_file)
    try:
        room = room_of(world)
    except ValueError:
        text = f"{map_file}: holds no wall, box, polygon or drum to hear; name the world file of the room"
        raise UserError(text, WRONG_CALL) from None
    settings, stand = read_stand(file, at_s, robot, json_file, force=force, options=options)
    heard = last_round(stand)
    candidates = localize(heard, room, settings.ring, reflection_of(world.acoustics.model))
    poses = [(robot_pose(one.pose, heard[-1]), one.probability) for one in candidates]
    if json_file is not None:
        rows = [{"x": at.x, "y": at.y, "heading": at.theta, "probability": share} for at, share in poses]
        write_json(json_file, {"firings": len(heard), "poses": rows})
    if not poses:
        raise UserError(
            f"{file}: no place in {map_file} explains what was heard from this stand; the map lacks what stood "
            "around the robot, its acoustics.model is the other one, or the robot file has other mounts; name "
            "another moment with --at, or follow the robot through its drive: `echolocate replay --localize --map`",
            FAILED,
        )
    output = plain_console()
    output.print(pose_table(poses, map_file, units))
    first_s, last_s = heard[0].robot_s, heard[-1].robot_s
    output.print(f"{len(heard)} firings from {first_s:.2f} to {last_s:.2f} s by the robot's clock")
    return DONE


def robot_pose(ring: Pose, firing: Firing) -> Pose:
    """Return the robot's pose in the map for a pose of its ring there: both are turned as they are in a firing."""
    return Pose(ring.x, ring.y, wrap_angle(ring.theta + firing.pose.theta - firing.ring_yaw))


def pose_table(poses: Sequence[tuple[Pose, float]], map_file: str, units: Units) -> Table:
    """Return a table of the robot's poses in the map, with the probability of each."""
    table = Table(title=f"Where in {map_file} this stand may be", title_justify="left")
    for name in (f"place ({units})", "heading", "probability"):
        table.add_column(name, justify="right", no_wrap=True)
    for pose, probability in poses:
        table.add_row(
            format_point(pose.x, pose.y, units), f"{math.degrees(pose.theta):.1f}°", f"{100.0 * probability:.1f} %"
        )
    return table
