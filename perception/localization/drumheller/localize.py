"""Global localisation in a known room from one stand of the ring, or from a short drive.

After M. Drumheller, "Mobile robot localization using sonar", IEEE Trans. PAMI 9(2), 1987: segments of the sonar
contour, interpretation tree, sonar barrier test. We read a summary of the paper, not the paper. The steps are the
paper's; how segments are cut from the contour, how many enter the tree, all tolerances, and a barrier test with the
whole beam instead of its axis are our reading. The paper ranks the surviving poses by how much of the contour lies on
walls. Here the likelihood of all raw ranges does that, and it gives each pose a probability.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.kernel import Floats
from perception.localization.drumheller.barrier import blocked_share
from perception.localization.drumheller.contour import contour_segments
from perception.localization.drumheller.interpretation_tree import interpretations, poses_along_walls
from perception.localization.drumheller.panorama import all_readings, panoramas
from perception.localization.drumheller.pose_fit import Stand, beams_at, fit_poses
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.range_likelihood import RangeModel, log_ratio_of_true_pose
from perception.localization.room.room import Room
from perception.shared_numbers import EVEN

SEGMENTS_MAX: Final = 8
"""Segments of a panorama that enter the tree. The paper takes the longest 3 or 4; on mirrors many are corners."""
BLOCKED_MAX: Final = 0.4
"""Largest share of echoes from behind walls: outliers are mostly long, and on mirrors eight echoes may be all."""
START_CELL_M: Final = 0.1
"""Of the poses in one cell of this edge, and of `START_CELL_RAD` in heading, one is tried."""
START_CELL_RAD: Final = math.radians(3.0)
"""Range of headings in `START_CELL_M`."""
BATCH: Final = 256
"""Poses that are tried in one call; bounds the memory."""
POSES_MAX: Final = 4096
"""Poses that are tried; what is beyond is left out."""
TURNS_RAD: Final = tuple(math.radians(turn) for turn in range(-6, 7, 3))
"""Headings that are tried around that of a leaf, which is good to some degrees."""
WIDE_TURNS_RAD: Final = tuple(math.radians(turn) for turn in range(-12, 13, 3))
"""The same around the heading from one segment, which may be anywhere in a beam."""
FINE_TURN_RAD: Final = math.radians(1.0)
FINE_TURNS: Final = 13
"""Step and number of the headings over which a pose's evidence is summed."""
FINE_FIT_STEPS: Final = 4
"""Steps of the fine fit."""
REFINED_MAX: Final = 24
"""Poses that are fitted finely."""
SAME_POSE_M: Final = 0.2
"""Poses nearer to each other than this, in heading than `SAME_POSE_RAD`, are one."""
SAME_POSE_RAD: Final = math.radians(7.0)
"""Difference of headings in `SAME_POSE_M`."""
LOST_SIGMAS: Final = 2.0
"""A pose that the search has missed is given a true pose's likelihood, so many standard deviations below its mean."""
HEADING_CELL_RAD: Final = math.radians(4.0)
"""Headings of a place that differ by more are candidates of their own: between the moments at which a turn moves an
echo into a beam or out of one, the ranges hardly depend on it."""
CANDIDATE_PROBABILITY_MIN: Final = 1e-3
"""Least probability of a candidate that is returned."""


@dataclass(frozen=True, slots=True)
class PoseCandidate:
    """A pose that the ring may have."""

    pose: Pose
    """Place (m) and direction of sensor 0 (rad) in the map frame, at the last firing."""
    probability: float
    """Its probability. What the probabilities of all candidates lack of 1 is that of any other place."""


def localize(
    firings: Sequence[Firing], room: Room, ring: RingConfig, reflection: Reflection
) -> tuple[PoseCandidate, ...]:
    """Return where in a room the ring may be, without knowing where it was before.

    Parameters
    ----------
    firings : sequence of Firing
        The readings of a stand, or of a drive short enough for odometry to compound them. Poses in odometry's frame.
    room : Room
        The walls, in the map frame.
    ring : RingConfig
        Places and beam of the sensors.
    reflection : str
        How the room reflects: `cone` or `specular`.

    Returns
    -------
    tuple of PoseCandidate
        Most probable first. A symmetric room gives every answer its share. Empty if the robot is lost: no pose
        explains the readings as well as a true one would.

    Raises
    ------
    ValueError
        There is no firing.
    """
    if not firings:
        raise ValueError("expected at least one firing")
    model = RangeModel.of_ring(ring)
    half_angle = math.radians(ring.beam_half_angle_deg)
    parts = panoramas(firings, ring)
    stand = Stand(room, all_readings(parts), half_angle, reflection, model)
    segments = [contour_segments(part, half_angle, reflection, model)[:SEGMENTS_MAX] for part in parts]
    mean, sigma = log_ratio_of_true_pose(model, stand.readings.range_m)
    leaves = [leaf[1:] for part in segments for leaf in interpretations(part, room)]
    starts = _promising(stand, np.array(leaves).reshape(-1, 3), TURNS_RAD)
    modes = _refined(stand, starts)
    if not modes or max(mode.log_ratio for mode in modes) < mean:
        rows = np.concatenate([poses_along_walls(part, room) for part in segments])
        modes = _refined(stand, np.concatenate([starts, _promising(stand, rows, WIDE_TURNS_RAD)]))
    if not modes:
        return ()
    missed = modes[0].log_evidence - modes[0].log_ratio + mean - LOST_SIGMAS * sigma
    total = float(np.logaddexp.reduce([missed, *(mode.log_evidence for mode in modes)]))
    if math.exp(missed - total) > EVEN:
        return ()
    found = [
        one for mode in modes for one in _candidates(mode, total) if one.probability >= CANDIDATE_PROBABILITY_MIN
    ]
    return tuple(sorted(found, key=lambda one: -one.probability))


class _Mode(NamedTuple):
    """A maximum of the posterior: the poses fitted around it at a row of headings."""

    mean: Floats
    """x, y (m), heading (rad), shape (3,)."""
    log_ratio: float
    """Log likelihood ratio at the best heading, nat."""
    log_evidence: float
    """Log of the density summed over the headings, nat."""
    poses: Floats
    """Shape (headings, 3)."""
    log_density: Floats
    """Of each heading, nat."""


def _promising(stand: Stand, poses: Floats, turns: Sequence[float]) -> Floats:
    """Return those of many poses that pass the barrier test, fitted coarsely, the best few, shape (m, 3)."""
    cells = np.rint(poses / (START_CELL_M, START_CELL_M, START_CELL_RAD))
    first = np.sort(np.unique(cells, axis=0, return_index=True)[1])[:POSES_MAX]
    fitted, score = [np.empty((0, 3))], [np.empty(0)]
    for begin in range(0, len(first), BATCH):
        batch = poses[first[begin : begin + BATCH]]
        beams = beams_at(stand.readings, *batch.T)
        batch = batch[blocked_share(stand.room, beams, stand.readings.range_m, stand.half_angle) <= BLOCKED_MAX]
        fit = fit_poses(stand, batch, np.array(turns), 1)
        best = (np.arange(len(batch)), fit.log_ratio.argmax(axis=1))
        fitted.append(np.column_stack([fit.x[best], fit.y[best], fit.theta[best]]))
        score.append(fit.log_ratio[best])
    every = np.concatenate(fitted)
    return every[_distinct(every, np.concatenate(score))]


def _refined(stand: Stand, starts: Floats) -> list[_Mode]:
    """Return the modes of the posterior near some starts, that of the largest evidence first."""
    turns = np.array([FINE_TURN_RAD * (k - FINE_TURNS // 2) for k in range(FINE_TURNS)])
    fit = fit_poses(stand, starts, turns, FINE_FIT_STEPS)
    area_m2 = max(stand.room.area_m2, SAME_POSE_M**2)  # a single wall along an axis has none
    log_cell = math.log(FINE_TURN_RAD / (2.0 * math.pi * area_m2))
    log_density = fit.log_ratio + fit.log_area + log_cell
    log_evidence = np.logaddexp.reduce(log_density, axis=1)
    poses = np.stack([fit.x, fit.y, fit.theta], axis=2)
    mean = (np.exp(log_density - log_evidence[:, None])[:, :, None] * poses).sum(axis=1)
    best = fit.log_ratio.max(axis=1)
    return [
        _Mode(mean[i], float(best[i]), float(log_evidence[i]), poses[i], log_density[i])
        for i in _distinct(mean, log_evidence)
    ]


def _candidates(mode: _Mode, total: float) -> list[PoseCandidate]:
    """Return the candidates of a mode, one for each cell of headings; `total` is the log evidence of all (nat)."""
    cells = np.rint((mode.poses[:, 2] - mode.mean[2]) / HEADING_CELL_RAD)
    found = []
    for cell in np.unique(cells):
        log_density, poses = mode.log_density[cells == cell], mode.poses[cells == cell]
        log_evidence = np.logaddexp.reduce(log_density)
        x, y, theta = (np.exp(log_density - log_evidence) @ poses).tolist()
        found.append(PoseCandidate(Pose(x, y, wrap_angle(theta)), math.exp(log_evidence - total)))
    return found


def _distinct(poses: Floats, score: Floats) -> list[int]:
    """Return the indices of the best poses, best first, without those near a better one; at most `REFINED_MAX`."""
    kept: list[int] = []
    for i in np.argsort(-score, kind="stable").tolist():
        off = poses[kept] - poses[i]
        turned = np.abs((off[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        if ((np.hypot(off[:, 0], off[:, 1]) > SAME_POSE_M) | (turned > SAME_POSE_RAD)).all():
            kept.append(i)
        if len(kept) == REFINED_MAX:
            break
    return kept
