"""The questions of `echolocate init robot` about where the sensors look, with what each answer costs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from behaviors.surroundings.field_of_view import path_half_angle_rad
from config.behaviors import ArbiterConfig
from config.robot import BodyConfig
from runtime.cli.commands.questions import Questions
from runtime.support.pattern_check import ring_that_drives

LAYOUTS: Final = ("all-round", "in-front", "one-by-one")
OVERLAP: Final = 5.0 / 6.0
"""Spacing of sensors in front, in widths of a beam: a beam that points 2° off leaves no gap of a 30° one."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """Where the sensors are, as `config.robot_file.RobotDraft` has it."""

    count: int | None
    radius_m: float | None
    sensors: tuple[tuple[float, float, float], ...] | None


class Described(NamedTuple):
    """What the answers before say of the robot."""

    body_radius_m: float
    beam_half_angle_deg: float
    most: int
    """The most sensors that its driver has."""
    usual: int
    """How many such robots usually have."""

    @property
    def path_deg(self) -> float:
        """The directions to either side of its way in which it must see, degrees."""
        body = BodyConfig(radius_m=self.body_radius_m, speed_max_m_s=1.0, turn_max_rad_s=1.0)
        return math.degrees(path_half_angle_rad(body, ArbiterConfig().clearance_m))


def ask_mounting(ask: Questions, robot: Described) -> Mounting:
    """Return where the sensors are, from options or answers.

    Parameters
    ----------
    ask
        The options and the person.
    robot
        What is known of it.
    """
    beam_deg = robot.beam_half_angle_deg
    ask.say(
        f"A body of {robot.body_radius_m:g} m must see every direction within {robot.path_deg:.0f}° of its way: "
        f"{ring_that_drives(beam_deg, robot.path_deg)}.\n"
        "  all-round: with so many no blind sides: it may go anywhere, backwards too\n"
        "  in-front: blind beside and behind: it looks to both sides every 2.5 m, and never drives backwards\n"
        "  one-by-one: each sensor's place and direction\n"
        "Each fires in turn: a ring of many sensors looks less often, which limits the speed.",
    )
    layout = ask.choice("layout", "Where the sensors look", LAYOUTS)
    count, usual_deg = robot.usual, max(1, math.floor(2.0 * OVERLAP * beam_deg))
    if layout == "in-front":
        count = 1 + max(0, math.ceil(2.0 * (robot.path_deg - beam_deg) / usual_deg))
    sensors = ask.count("sensors", "Number of sensors", count, 1, robot.most)
    ring_m = ask.number("ring_radius", "Distance of the sensors from the middle, m", robot.body_radius_m, 0.0, 10.0)
    if layout == "all-round":
        return Mounting(sensors, ring_m, None)
    apart = 0.0
    if layout == "in-front" and sensors > 1:
        ask.say(f"Beams more than {2.0 * beam_deg:g}° apart leave gaps, which the robot does not drive into.")
        default = min(usual_deg, max(1, 180 // sensors))
        apart = ask.number("spacing", "Degrees from one sensor to the next", default, 0.5, 180.0)
    placed = []
    for k in range(sensors):
        angle_deg = (0.5 * (sensors - 1) - k) * apart
        if layout == "one-by-one":
            angle_deg = 360.0 * k / sensors
            angle_deg = ask.number(f"direction_{k}", f"Direction of sensor {k}, °", angle_deg, -360.0, 360.0)
        turn = math.radians(angle_deg)
        x, y = round(ring_m * math.cos(turn), 4), round(ring_m * math.sin(turn), 4)
        if layout == "one-by-one":
            x = ask.number(f"x_{k}", f"Place of sensor {k} forward, m", x, -10.0, 10.0)
            y = ask.number(f"y_{k}", f"Place of sensor {k} to the left, m", y, -10.0, 10.0)
        placed.append((x, y, angle_deg))
    return Mounting(None, None, tuple(placed))
