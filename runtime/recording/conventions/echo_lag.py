"""Firings at the poses from which they were heard, where the poses of a ring log are those of other moments."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

from drivers.messages import Firing, Pose, wrap_angle


def at_heard_poses(firings: Iterable[Firing], lag_s: float) -> Iterator[Firing]:
    """Yield firings at the poses of the moment so long before each.

    Parameters
    ----------
    firings : iterable of Firing
        In order of time.
    lag_s : float
        Below 0, poses come from later firings: each is yielded once those are there. Before the first pose and after
        the last one the robot stands.
    """
    if lag_s == 0.0:
        yield from firings
        return
    known: deque[Firing] = deque()
    waiting: deque[Firing] = deque()
    for firing in firings:
        known.append(firing)
        waiting.append(firing)
        while waiting and waiting[0].robot_s - lag_s <= firing.robot_s:
            yield _moved(waiting.popleft(), known, lag_s)
    while waiting:
        yield _moved(waiting.popleft(), known, lag_s)


def _moved(firing: Firing, known: deque[Firing], lag_s: float) -> Firing:
    """Return a firing at the pose of another moment, and forget what no later one needs."""
    at_s = firing.robot_s - lag_s
    while len(known) > 2 and known[1].robot_s <= at_s:
        known.popleft()
    before = known[0]
    after = next((one for one in known if one.robot_s > at_s), known[-1])
    span_s = after.robot_s - before.robot_s
    share = min(max((at_s - before.robot_s) / span_s, 0.0), 1.0) if span_s > 0.0 else 0.0
    pose, yaw = pose_between(before, after, share)
    return replace(firing, pose=pose, ring_yaw=yaw)


def pose_between(before: Firing, after: Firing, share: float) -> tuple[Pose, float]:
    """Return pose and ring's direction on the straight way from one firing to another, after this share of it."""
    a, b = before.pose, after.pose
    theta = a.theta + share * wrap_angle(b.theta - a.theta)
    yaw = before.ring_yaw + share * wrap_angle(after.ring_yaw - before.ring_yaw)
    return Pose(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), theta), yaw
