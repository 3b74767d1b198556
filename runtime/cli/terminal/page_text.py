"""What the console's page writes, as it writes it (its `units.js`, `objects.js`, `status.js`, `walls.js`)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import ROUND_HALF_UP, Decimal
from typing import TYPE_CHECKING, Final

from config.units import FOOT_M
from perception.detected_object import DetectedObject, worst_sigma
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from perception.localization.localized_pose import LocalizedPose

BEHIND_M: Final = 0.1
"""An object in front of a wall may touch it."""
SPREAD_DIGITS: Final = 4
"""A standard error has at most so many decimals: a tenth of a millimetre."""


def number(metres: float, units: Units, digits: int = 2) -> str:
    """Return a length without its unit, rounded as JavaScript's `toFixed` does, with a true minus sign."""
    value = Decimal(metres if units == "m" else metres / FOOT_M)
    rounded = (value + 0).quantize(Decimal(1).scaleb(-digits), ROUND_HALF_UP)
    return f"{rounded:f}".replace("-", "\N{MINUS SIGN}")


def length(metres: float, units: Units, digits: int = 2) -> str:
    """Return a length with its unit."""
    return f"{number(metres, units, digits)} {units}"


def spread(sigma_m: float, units: Units) -> str:
    """Return a standard error in the unit of the page, with two digits that count, or the last of `SPREAD_DIGITS`."""
    if not sigma_m < 10_000.0:
        return "± more than 10 km"
    shown = sigma_m if units == "m" else sigma_m / FOOT_M
    digits = sum(shown < 9.95 * 0.1**k for k in range(SPREAD_DIGITS))
    least = 0.1**SPREAD_DIGITS
    said = length(sigma_m, units, digits) if shown >= 0.5 * least else f"less than {least:.{SPREAD_DIGITS}f} {units}"
    return f"± {said}"


def place(x: float, y: float, units: Units) -> str:
    """Return a point, given in metres, with its unit."""
    return f"{number(x, units)}, {number(y, units)} {units}"


def degrees(radians: float) -> str:
    """Return an angle in whole degrees from −180 to 180, however often the robot has turned."""
    angle = math.floor(math.degrees(math.atan2(math.sin(radians), math.cos(radians))) + 0.5)
    return f"{angle}°".replace("-", "\N{MINUS SIGN}")


def turn_spread(sigma_rad: float) -> str:
    """Return an angle's standard error; no evidence makes it nought."""
    sigma_deg = math.degrees(sigma_rad)
    return f"± {sigma_deg:.1f}°" if sigma_deg >= 0.05 else "± less than 0.1°"


def percent(share: float) -> str:
    """Return a probability in whole per cent; no evidence makes it 0 or 100."""
    return f"{'> 99' if share >= 0.995 else '< 1' if share < 0.005 else math.floor(100.0 * share + 0.5)} %"


def is_hidden(
    seen: DetectedObject, radius_m: float, robot: tuple[float, float], objects: Iterable[DetectedObject]
) -> bool:
    """Return whether a wall hides an object: the sight line to its middle crosses it, and all of it lies beyond.

    Parameters
    ----------
    seen
        The object; no wall counts as hidden.
    radius_m
        Of the object.
    robot
        x, y in the frame of the objects, m.
    objects
        All that are reported, walls among them.
    """
    if seen.ends is not None:
        return False
    robot_x, robot_y = robot
    for wall in objects:
        if wall.ends is None:
            continue
        x1, y1, x2, y2 = wall.ends
        dx, dy, sx, sy = x2 - x1, y2 - y1, seen.x - robot_x, seen.y - robot_y
        of_robot, of_object = dx * (robot_y - y1) - dy * (robot_x - x1), dx * (seen.y - y1) - dy * (seen.x - x1)
        of_ends = (sx * (y1 - robot_y) - sy * (x1 - robot_x)) * (sx * (y2 - robot_y) - sy * (x2 - robot_x))
        square = dx * dx + dy * dy
        along = 0.0 if square == 0.0 else min(1.0, max(0.0, ((seen.x - x1) * dx + (seen.y - y1) * dy) / square))
        away_m = math.hypot(seen.x - x1 - along * dx, seen.y - y1 - along * dy)
        if of_robot * of_object < 0.0 and of_ends < 0.0 and away_m > radius_m + BEHIND_M:
            return True
    return False


def certainty(seen: DetectedObject, *, hidden: bool = False) -> str:
    """Return what is known of an object: what an operator said counts more than a number.

    Behind a wall no reading checks the number.
    """
    if hidden and not seen.confirmed:
        return "hidden"
    if seen.placed and not seen.confirmed:
        return "placed"
    return f"{'✓ ' if seen.confirmed else ''}{percent(seen.score if seen.probability is None else seen.probability)}"


def object_row(seen: DetectedObject, units: Units, *, hidden: bool = False) -> tuple[str, str, str, str, str]:
    """Return number, name, certainty, place and uncertainty of an object, or the length of a wall."""
    if seen.ends is None:
        where = f"{place(seen.x, seen.y, units)}, {degrees(seen.theta)}"
        size = spread(seen.sigma, units)
    else:
        x1, y1, x2, y2 = seen.ends
        where = f"{number(x1, units)}, {number(y1, units)} to {place(x2, y2, units)}"
        size = f"{length(math.hypot(x2 - x1, y2 - y1), units)} long"
    return "–" if seen.number is None else str(seen.number), seen.model, certainty(seen, hidden=hidden), where, size


def twist(v: float, w: float, units: Units) -> str:
    """Return speed (m/s) and turning rate (rad/s) of the robot."""
    turn = math.floor(math.degrees(w) + 0.5)
    arrow = "↻ " if turn < 0 else "↺ " if turn > 0 else ""
    return f"{number(v, units)} {units}/s {arrow}{abs(turn)}°/s"


def localized_place(here: LocalizedPose, units: Units) -> str:
    """Return the robot's place in the map frame, with the standard errors of its worst direction and its heading."""
    said = f"{here.status} {percent(here.probability)}"
    covariance = here.covariance
    if not math.isfinite(float(covariance.sum())):
        return f"unknown, {said}"
    sigma = worst_sigma(float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1]))
    at = f"{number(here.pose.x, units)}, {number(here.pose.y, units)} {spread(sigma, units)}"
    return f"{at}, {degrees(here.pose.theta)} {turn_spread(math.sqrt(covariance[2, 2]))}, {said}"
