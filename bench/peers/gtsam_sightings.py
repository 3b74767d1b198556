"""GTSAM's iSAM2 on sightings of posts: a pose for each sighting, and odometry between them."""

from __future__ import annotations

import math
import time
from typing import Final

import gtsam
import numpy as np

from bench.sightings import ROBUST_SIGMAS, Recording, errors, noise, steps_between

STILL_SIGMA: Final = 1e-4
"""Least standard deviation of a step by odometry, m and rad."""
FIRST_SIGMA: Final = 1e-6


def figures(recording: Recording, odometer_scale: float, turn_scale: float) -> dict[str, float]:
    """Return the errors of the posts at the end, and the time of an update.

    Parameters
    ----------
    recording : Recording
        The drive.
    odometer_scale, turn_scale : float
        Reported over true way, and true over reported turn: these factors cannot find them.
    """
    isam = gtsam.ISAM2(gtsam.ISAM2Params())
    here, seen, took_ms = gtsam.Pose2(), set[int](), list[float]()
    for k, (step, (_, subject, distance, bearing)) in enumerate(
        zip(steps_between(recording), recording.sightings.tolist(), strict=True)
    ):
        number, pose_key, post_key = int(subject), gtsam.symbol("x", k), gtsam.symbol("l", int(subject))
        begin_s = time.thread_time()
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        half = gtsam.Pose2(0.0, 0.0, 0.5 * step.turn * turn_scale)
        moved = half.compose(gtsam.Pose2(step.forward / odometer_scale, step.left / odometer_scale, 0.0)).compose(
            half
        )
        if k == 0:
            graph.add(gtsam.PriorFactorPose2(pose_key, here, gtsam.noiseModel.Isotropic.Sigma(3, FIRST_SIGMA)))
        else:
            place, turn = (math.sqrt(v + STILL_SIGMA**2) for v in (step.place_variance, step.turn_variance))
            model = gtsam.noiseModel.Diagonal.Sigmas(np.array([place, place, turn]))
            graph.add(gtsam.BetweenFactorPose2(gtsam.symbol("x", k - 1), pose_key, moved, model))
            here = here.compose(moved)
        values.insert(pose_key, here)
        if number not in seen:
            seen.add(number)
            values.insert(post_key, here.transformFrom(gtsam.Point2(*_polar(distance, bearing))))
        along, across = noise(distance)
        sigmas = np.array([math.sqrt(across) / distance, math.sqrt(along)])
        robust = gtsam.noiseModel.Robust.Create(
            gtsam.noiseModel.mEstimator.Huber.Create(ROBUST_SIGMAS), gtsam.noiseModel.Diagonal.Sigmas(sigmas)
        )
        graph.add(gtsam.BearingRangeFactor2D(pose_key, post_key, gtsam.Rot2(bearing), distance, robust))
        isam.update(graph, values)
        here = isam.calculateEstimatePose2(pose_key)
        took_ms.append(1e3 * (time.thread_time() - begin_s))
    places = {n: tuple(isam.calculateEstimatePoint2(gtsam.symbol("l", n)).tolist()) for n in sorted(seen)}
    off = errors(recording, places)
    return {
        "landmarks": len(off),
        "rms_m": float(np.sqrt(np.mean(off**2))),
        "max_m": float(off.max()),
        "median_ms": float(np.median(took_ms)),
        "mean_ms": float(np.mean(took_ms)),
    }


def _polar(distance: float, bearing: float) -> tuple[float, float]:
    return distance * math.cos(bearing), distance * math.sin(bearing)
