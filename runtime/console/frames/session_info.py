"""What a page is told first: the robot's shape, what it looks for, and, of an emulated one, what stands there."""

from __future__ import annotations

import math
from typing import Any

from config.settings import Settings
from config.world import StartConfig, WorldConfig
from drivers.messages import Pose
from runtime import VERSION
from runtime.console.commands.parameters import parameters
from runtime.support.length_format import Units


def session_info(settings: Settings, *, name: str | None, emulated: bool, units: Units) -> dict[str, Any]:
    """Return what every client is greeted with; the greeting of one of them adds its role.

    Parameters
    ----------
    settings : Settings
        In force.
    name : str, optional
        What the robot calls itself.
    emulated : bool
        Whether the settings' world is what the robot meets.
    units : {"m", "ft"}
        In which figures are to be shown.
    """
    ring, body = settings.ring, settings.body
    return {
        "type": "session",
        "version": VERSION,
        "name": name,
        "emulated": emulated,
        "units": units,
        "ring": {
            "mounts": [[mount.x_m, mount.y_m, mount.angle_rad] for mount in ring.mounts],
            "half_angle": math.radians(ring.beam_half_angle_deg),
            "range_min": ring.range_min_m,
            "range_max": ring.range_max_m,
        },
        "body": {"radius": body.radius_m, "speed_max": body.speed_max_m_s, "turn_max": body.turn_max_rad_s},
        "models": [
            {"name": m.name, "vertices": m.vertices_m, "closed": m.closed, "arc_radius_m": m.arc_radius_m}
            for m in settings.models
        ],
        "truth": truth(settings.world) if emulated and settings.world is not None else None,
        "parameters": parameters(settings),
        "budget_s": settings.cycle.perception_budget_s,
        "period_s": 1.0 / settings.cycle.rate_hz,
    }


def truth(world: WorldConfig) -> dict[str, Any]:
    """Return what stands in a world, in the frame of an odometry that begins at its start, m."""
    frame = _pose(world.start).inverse()

    def point(x: float, y: float) -> tuple[float, float]:
        there = frame.compose(Pose(x, y, 0.0))
        return there.x, there.y

    polygons = [[point(*vertex) for vertex in polygon.vertices_m] for polygon in world.polygon]
    for box in world.box:
        w, d, middle = 0.5 * box.width_m, 0.5 * box.depth_m, Pose(box.x_m, box.y_m, math.radians(box.angle_deg))
        corners = [middle.compose(Pose(x, y, 0.0)) for x, y in ((w, -d), (w, d), (-w, d), (-w, -d))]
        polygons.append([point(corner.x, corner.y) for corner in corners])
    return {
        "drums": [[*point(drum.x_m, drum.y_m), drum.radius_m] for drum in world.drum],
        "walls": [[*point(wall.x1_m, wall.y1_m), *point(wall.x2_m, wall.y2_m)] for wall in world.wall],
        "polygons": polygons,
    }


def _pose(start: StartConfig) -> Pose:
    return Pose(start.x_m, start.y_m, math.radians(start.heading_deg))
