"""Recognition as a library: numpy arrays of poses and ranges in, objects out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing, Floats, Pose
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from perception.polyline import Polyline

__all__ = ["Recogniser"]


class Recogniser:
    """Recognises objects in the readings of a ring of sonars, firing by firing.

    Parameters
    ----------
    ring : RingConfig
        The sensors, as in ``config.load.load_robot("p3dx").ring``.
    models : sequence of ModelConfig
        The objects to recognise, as in ``[config.load.load_model("drum")]``.
    config : PerceptionConfig, optional
        The method and its settings.
    """

    def __init__(
        self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig | None = None
    ) -> None:
        self.perception = Perception(ring, models, PerceptionConfig() if config is None else config)
        """All that is known: segments, walls, edits of the map, snapshots."""
        self._sensors = len(ring.mounts)
        self._time_s = -math.inf

    def add(
        self, poses: ArrayLike, ranges_m: ArrayLike, times_s: ArrayLike, ring_yaws: ArrayLike | None = None
    ) -> None:
        """Enter firings, in the order of their times; each is refined until nothing is left to improve.

        Parameters
        ----------
        poses : (k, 3) array
            x, y (m) and heading (rad) of the robot at each firing, by odometry.
        ranges_m : (k, n) array
            A range for each of the ring's n sensors; inf where one heard nothing, NaN where it did not fire.
        times_s : (k,) array
            When each set of sensors fired, s.
        ring_yaws : (k,) array, optional
            Direction of a ring that does not turn with the robot, rad; by default that of the robot.

        Raises
        ------
        ValueError
            A shape does not fit, a pose or a time is not finite, a time is before the one before it, or a range is
            negative. Nothing is entered then.
        """
        at, given = np.array(poses, float, ndmin=2), np.array(ranges_m, float, ndmin=2)
        times = np.array(times_s, float, ndmin=1)
        yaws = at[:, 2] if ring_yaws is None and at.shape[1:] == (3,) else np.array(ring_yaws, float, ndmin=1)
        self._check(at, given, times, yaws)
        for pose, ranges, time_s, yaw in zip(at, given, times, yaws, strict=True):
            x, y, theta = pose.tolist()
            self.perception.observe(Firing(float(time_s), Pose(x, y, theta), float(yaw), ranges))
            while self.perception.can_refine:
                self.perception.refine()
            self._time_s = float(time_s)

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised so far, in the frame of the poses, best first."""
        return self.perception.objects()

    def surroundings(self) -> tuple[DetectedObject, ...]:
        """Return what has a label near the robot: models, walls, corners, edges, posts, unknown objects."""
        return self.perception.labelled_objects()

    def polylines(self) -> tuple[Polyline, ...]:
        """Return the outlines of what is not straight, in the frame of the poses."""
        return self.perception.polylines()

    def _check(self, poses: Floats, ranges_m: Floats, times_s: Floats, ring_yaws: Floats) -> None:
        """Check what a person may get wrong; compiled code reads it unchecked.

        Raises
        ------
        ValueError
            As `add` says.
        """
        firings = len(poses)
        if poses.shape != (firings, 3):
            raise ValueError(f"poses of shape {poses.shape}: expected one row x, y, heading for each firing")
        if ranges_m.shape != (firings, self._sensors):
            raise ValueError(
                f"ranges of shape {ranges_m.shape} for {firings} poses and {self._sensors} sensors: expected "
                f"{(firings, self._sensors)}, with NaN for sensors that did not fire"
            )
        for name, given in (("times", times_s), ("ring yaws", ring_yaws)):
            if given.shape != (firings,):
                raise ValueError(f"{name} of shape {given.shape} for {firings} poses: expected one for each")
            if not np.isfinite(given).all():
                raise ValueError(f"{name} that are not finite")
        if not np.isfinite(poses).all():
            raise ValueError("poses that are not finite: leave out firings without odometry")
        if (np.diff(times_s, prepend=self._time_s) < 0.0).any():
            raise ValueError("times that decrease: sort the firings, or make a new Recogniser for another drive")
        if (ranges_m < 0.0).any():
            raise ValueError("negative ranges: expected metres, inf for no echo, NaN for a sensor that did not fire")
