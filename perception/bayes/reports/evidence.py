"""Evidence of each reading for or against an object, for display to users.

Nothing here changes the memory, because a replay in which no user requested the evidence must not differ. Terms that
belong to all readings together (the price of many drop-outs) are left out.
"""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.inference.beam import answer
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.occlusion import find_others, is_relevant
from perception.bayes.inference.range_fit import score_circle
from perception.bayes.inference.reservoir import add_crosses, copy_reservoir
from perception.bayes.memory.elements import COMPARED_MAX, Reading
from perception.bayes.memory.scratch import OtherCircle, Predictions, Score
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, Memory, StateRecord
from perception.bayes.polygons.likelihood import score_polygon
from perception.edits import Arc, Evidence
from perception.kernel import Floats, kernel
from perception.records import Records, records, zeros
from perception.shared_numbers import FAR


@kernel
def circle_evidence(
    s: StateRecord,
    tracks: CircleTracks,
    p: SettingsRecord,
    t: int,
    readings: Records[Reading],
    score: Records[Score],
    predicted: Records[Predictions],
    others: Records[OtherCircle],
    nats: Floats,
) -> int:
    """Write the evidence of each reading for circle `t`, 0 where it does not bear on it; return how many there are.

    Parameters
    ----------
    s, tracks, p
        Memory, circles and settings.
    t : int
        The track.
    readings : (COMPARED_MAX,) Reading
        Out: the readings.
    score : (1,) Score
        Scratch.
    predicted : (1,) Predictions
        Scratch.
    others : (≥ number of tracks,) OtherCircle
        Scratch.
    nats : (COMPARED_MAX,) float
        Out: the evidence of each, nat.
    """
    track = tracks[t]
    var0, rel2 = noise_variance(s, p)
    n = copy_reservoir(track, readings)
    n = add_crosses(s, p, track.x, track.y, track.radius, readings, n)
    known = others[: find_others(tracks, t, p, track.x, track.y, track.radius, s[0].rays, others)]
    predicted[0].rays = s[0].rays
    predicted[0].half_angle = p[0].half_angle_rad
    for j in range(n):
        nats[j] = 0.0
        q = readings[j]
        d = math.hypot(track.x - q.x, track.y - q.y)
        e, _ = answer(q, track.x - q.x, track.y - q.y, d, track.radius, p[0].half_angle_rad, s[0].rays)
        if is_relevant(known, p, q, (track.x, track.y, track.radius), d, e, var0, rel2):
            score_circle(
                readings[j : j + 1], track.x, track.y, track.radius, p, s[0].noise_level, predicted[0], score[0]
            )
            nats[j] = score[0].log_likelihood_ratio
    return n


@kernel
def polygon_evidence(
    s: StateRecord, p: SettingsRecord, t: int, readings: Records[Reading], score: Records[Score], nats: Floats
) -> int:
    """Write the evidence of each reading for polygon `t`, 0 where it does not bear on it; return how many there are.

    Parameters
    ----------
    s, p, t, readings, score, nats
        As for `circle_evidence`.
    """
    track = s[0].polygons[t]
    outline = p[0].polygons[track.model]
    sides = outline.sides[: outline.side_count]
    n = copy_reservoir(track, readings)
    for j in range(n):
        nats[j] = score_polygon(
            readings[j : j + 1],
            1,
            (track.x, track.y, track.heading),
            sides,
            outline.is_closed > 0,
            p,
            s[0].noise_level,
            score[0],
        )
    return n


def evidence_of(
    memory: Memory, p: SettingsRecord, row: int, number: int, model: str, labels: tuple[str, ...]
) -> Evidence:
    """Return the evidence of each reading kept for a track.

    Parameters
    ----------
    memory, p
        Memory and settings.
    row : int
        The track: circles first, then polygons.
    number, model
        The object's number and name.
    labels : tuple of str
        Names of the alternatives of a circle.
    """
    heard, nats = zeros(Reading, COMPARED_MAX), np.zeros(COMPARED_MAX)
    readings, score = records(Reading, heard), records(Score, zeros(Score, 1))
    t, rivals = row - len(memory.circles), tuple[tuple[str, float], ...]()
    if t < 0:
        predicted = records(Predictions, zeros(Predictions, 1))
        others = records(OtherCircle, zeros(OtherCircle, len(memory.circles)))
        n = circle_evidence(memory.s, memory.tracks, p, row, readings, score, predicted, others, nats)
        own = int(memory.circles["kind"][row])
        leads = memory.circles["leads"][row, : len(labels)].tolist()
        rivals = tuple((labels[k], v) for k, v in enumerate(leads) if k != own and v != 0.0)
    else:
        n = polygon_evidence(memory.s, p, t, readings, score, nats)
    arcs = tuple(
        Arc(x, y, float(np.arctan2(uy, ux)), r if r < FAR else None, nat, (x + lx, y + ly) if lx or ly else None)
        for (x, y, ux, uy, r, lx, ly), nat in zip(heard[:n].tolist(), nats[:n].tolist(), strict=True)
    )
    said = nats[:n]
    return Evidence(
        number,
        model,
        arcs=arcs,
        supporting=float(said[said > 0.0].sum()),
        opposing=float(said[said < 0.0].sum()),
        rivals=rivals,
    )
