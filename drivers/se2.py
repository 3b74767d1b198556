"""Motion at constant twist: exponential and logarithm of SE(2), and interpolation with them.

Between two odometry samples a base moves along an arc, not along its chord; a firing is placed on that arc.
"""

from __future__ import annotations

import math

from drivers.messages import Pose

_SMALL_RAD = 1e-4
"""Angle below which the series is used: it is exact to a bit or two, while the closed form divides two small
numbers."""


def exp(x: float, y: float, theta: float) -> Pose:
    """Return the pose that a constant twist reaches from the origin in unit time.

    Parameters
    ----------
    x, y
        Velocity, m per unit time.
    theta
        Turning rate, rad per unit time.

    Notes
    -----
    With V = [[sin θ/θ, −(1 − cos θ)/θ], [(1 − cos θ)/θ, sin θ/θ]] the position is V·(x, y): Selig, *Geometric
    Fundamentals of Robotics*, 2nd ed., §4.5; Sola et al., *A micro Lie theory*, eq. 155-158.
    """
    if abs(theta) < _SMALL_RAD:
        a, b = 1.0 - theta * theta / 6.0, theta / 2.0
    else:
        half = math.sin(theta / 2.0)
        a, b = math.sin(theta) / theta, 2.0 * half * half / theta
    return Pose(a * x - b * y, b * x + a * y, theta)


def log(pose: Pose) -> tuple[float, float, float]:
    """Return the constant twist (x, y, theta) that reaches `pose` from the origin in unit time.

    `pose.theta` is not wrapped. The inverse of V is [[c, h], [−h, c]] with h = θ/2, c = h/tan h.

    Raises
    ------
    ValueError
        `pose.theta` is a full turn or more: infinitely many twists, or none, lead there.
    """
    if abs(pose.theta) >= 2.0 * math.pi:
        raise ValueError(f"a turn of {pose.theta:g} rad has no single twist: it must be less than a full turn")
    h = pose.theta / 2.0
    c = 1.0 - h * h / 3.0 if abs(h) < _SMALL_RAD else h / math.tan(h)
    return c * pose.x + h * pose.y, c * pose.y - h * pose.x, pose.theta


def interpolate(start: Pose, end: Pose, share: float) -> Pose:
    """Return a pose between two poses, on the path of a constant twist.

    Headings are unwrapped: the body turns by ``end.theta - start.theta``. Beyond half a turn the arc is unlikely to
    be the true path, and the position is interpolated along the chord.

    `share` is that of the time between them, 0 to 1.
    """
    if share <= 0.0:
        return start
    if share >= 1.0:
        return end
    step = start.inverse().compose(end)
    if abs(step.theta) > math.pi:
        return start.compose(Pose(share * step.x, share * step.y, share * step.theta))
    x, y, theta = log(step)
    return start.compose(exp(share * x, share * y, share * theta))
