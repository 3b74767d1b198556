"""Selection of the tracks that are reported as models.

A model is named late, and then stays named: it must be probable, well located, and clearly better than an unknown
object, which explains any few echoes to some degree.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.memory.elements import MAX_POLYGONS, POLYGON_BIN_CAPACITY
from perception.bayes.memory.parameters import (
    ALONE_LEAD_NAT,
    IN_WALL_NAT,
    NAMED_DISPERSION_MIN,
    NAMED_OVER_UNKNOWN,
    NAMED_OVER_UNKNOWN_ALONE,
    NAMED_SIGMA_MAX_M,
    NO_WALL_LEAD_NAT,
)
from perception.bayes.memory.polygon_parameters import (
    MANY_HITS,
    POLYGON_DISPERSION_MIN,
    POLYGON_NAMED_HITS_SWEPT,
    POLYGON_NEAR_M,
    POLYGON_SIGMA_MAX_M,
    POLYGON_SWEPT_READINGS,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, CircleTrack, CircleTracks, PolygonTrack, StateRecord
from perception.kernel import Ints, kernel
from perception.records import Record, Records
from perception.shared_numbers import EVEN, FAR

OVERLAP_MAX_M: Final = 0.1 * FOOT_M
"""Two named circles overlap by no more than this, which their positions may be wrong by."""


class Reported(Record):
    """The values with which a circle was last reported."""

    x: float
    y: float
    covariance_xx: float
    covariance_xy: float
    covariance_yy: float
    hits: float
    probability: float
    kind: float
    number: float
    marks: float


@kernel
def best_other_lead(track: CircleTrack, p: SettingsRecord) -> float:
    """Return the greatest lead of any other body, priors left out; 0 where other outlines were not compared, nat."""
    best = track.outline_lead
    for k in range(p[0].circle_count + 2):
        if k != track.kind and track.leads[k] != 0.0:
            best = max(best, track.leads[k])
    return float(best)


@kernel
def is_name_doubtful(track: CircleTrack, p: SettingsRecord, sure: float, careful: bool) -> bool:
    """Return whether a model's checks speak against its name; see `perception.bayes.tracks.model_check`.

    Parameters
    ----------
    track, p, sure
        As of `update_name`.
    careful : bool
        Whether the prior is as much against a model as it is for it elsewhere.
    """
    if track.room_lead > IN_WALL_NAT:
        return True
    return bool(careful and best_other_lead(track, p) > -p[0].model_prior_nat - math.log(sure / (1.0 - sure)))


@kernel
def is_compared(track: CircleTrack, p: SettingsRecord) -> bool:
    """Return whether every alternative was compared with a circle since it began, or became what it is.

    With many readings a refinement compares one alternative only, and what was not compared weighs nothing: until the
    last one was, the probability is too high.
    """
    return bool(track.reservoir < p[0].compare_all_below or track.refinements > p[0].circle_count)


@kernel
def update_name(
    track: CircleTrack, p: SettingsRecord, sure: float, least: float, careful: bool, is_standing: bool
) -> None:
    """Name a track after a model once that is sure; withdraw the name once it is no longer likely.

    Without this hysteresis a name would come and go with each comparison, and could not be used for steering.

    Parameters
    ----------
    track : CircleTrack
        Updated.
    p : (1,) Settings
        Which circles are models.
    sure, least : float
        Least probability to give a name, and the same where a wall is excluded.
    careful : bool
        As of `is_name_doubtful`.
    is_standing : bool
        Whether the robot stands: then no echo that drops out takes away a name that is likely.
    """
    line = p[0].circle_count
    if track.leads[line] == 0.0 or track.leads[line] > NO_WALL_LEAD_NAT:
        least = sure
    if (
        track.status != ESTABLISHED
        or track.kind >= p[0].model_count
        or track.probability < min(least, EVEN)
        or is_name_doubtful(track, p, EVEN if track.is_named == 1 else sure, careful)
    ):
        track.is_named = 0
        return
    if is_standing and track.is_named == 1:
        return
    best = -1e300
    for k in range(line + 2):
        if k != track.kind:
            best = max(best, track.leads[k])
    over = NAMED_OVER_UNKNOWN_ALONE if best < ALONE_LEAD_NAT else NAMED_OVER_UNKNOWN
    is_vague = max(track.covariance_xx, track.covariance_yy) >= NAMED_SIGMA_MAX_M**2
    if track.log_likelihood_ratio <= over * track.unknown_nat or track.dispersion < NAMED_DISPERSION_MIN or is_vague:
        track.is_named = 0
    elif track.probability >= least and is_compared(track, p):
        track.is_named = 1


@kernel
def withdraw_overlapping(tracks: CircleTracks, t: int) -> None:
    """Withdraw the name of every circle that overlaps a named one of more evidence: bodies do not.

    Behind a drum nothing is heard, so that little contradicts what a few strays seem to show there.

    Parameters
    ----------
    tracks : (n,) CircleTrack
        Updated.
    t : int
        A circle that was just named, or not: only pairs that it is one of are compared.
    """
    track = tracks[t]
    for k in range(len(tracks)):
        if track.status != ESTABLISHED or track.is_named == 0:
            return
        other = tracks[k]
        if k == t or other.status != ESTABLISHED or other.is_named == 0:
            continue
        if math.hypot(other.x - track.x, other.y - track.y) < track.radius + other.radius - OVERLAP_MAX_M:
            if other.log_likelihood_ratio > track.log_likelihood_ratio:
                track.is_named = 0
            else:
                other.is_named = 0


@kernel
def report_circles(tracks: CircleTracks, p: SettingsRecord, reported: Records[Reported], sure: Ints) -> int:
    """Write the circles that are models to `sure`, changed ones as ~t; return the number of circles written.

    A model is reported for its readings or for a user's mark. A mark on a circle of another kind, which only a
    damaged file has, does not count.

    Parameters
    ----------
    tracks, p
        The circles, and how many of their kinds are models.
    reported : (n,) Reported
        The values each was last reported with; updated.
    sure : (≥ n,) int
        Out.
    """
    n = 0
    for t in range(len(tracks)):
        track = tracks[t]
        is_named = track.status == ESTABLISHED and track.is_named == 1
        is_marked = track.status != FREE and track.marks != 0 and track.kind < p[0].model_count
        if is_named or is_marked:
            sure[n] = ~t if update_reported(track, reported[t]) else t
            n += 1
    return n


@kernel
def update_reported(track: CircleTrack, last: Reported) -> bool:
    """Update a circle's reported values; return whether they changed."""
    is_same = (
        last.x == track.x
        and last.y == track.y
        and last.covariance_xx == track.covariance_xx
        and last.covariance_xy == track.covariance_xy
        and last.covariance_yy == track.covariance_yy
        and last.hits == track.hits
        and last.probability == track.probability
        and last.kind == track.kind
        and last.number == track.number
        and last.marks == track.marks
    )
    last.x = track.x
    last.y = track.y
    last.covariance_xx = track.covariance_xx
    last.covariance_xy = track.covariance_xy
    last.covariance_yy = track.covariance_yy
    last.hits = track.hits
    last.probability = track.probability
    last.kind = float(track.kind)
    last.number = float(track.number)
    last.marks = float(track.marks)
    return not is_same


@kernel
def is_sure_polygon(track: PolygonTrack, least: float) -> bool:
    """Return whether a polygon's readings make it sure, with at least this probability."""
    largest = max(track.covariance.xx, track.covariance.yy)
    if track.status != ESTABLISHED or track.probability < least or largest > POLYGON_SIGMA_MAX_M**2:
        return False
    swept = 0
    nearest = FAR
    heard = 0
    x = 0.0
    y = 0.0
    for b in range(len(track.bins)):
        kept = track.bins[b]
        swept += min(kept.count, POLYGON_BIN_CAPACITY)
        for k in range(min(kept.count, POLYGON_BIN_CAPACITY)):
            q = kept.readings[k]
            if q.range_m < FAR:
                nearest = min(nearest, q.range_m)
                x += q.axis_x
                y += q.axis_y
                heard += 1
    if track.hits < (POLYGON_NAMED_HITS_SWEPT if swept >= POLYGON_SWEPT_READINGS else MANY_HITS):
        return False
    return heard > 0 and nearest <= POLYGON_NEAR_M and 1.0 - math.hypot(x, y) / heard > POLYGON_DISPERSION_MIN


@kernel
def sure_polygons(s: StateRecord, least: float, out: Ints) -> int:
    """Write the polygons that are sure, or marked by a user, to `out`; return the number of them.

    Parameters
    ----------
    s : (1,) State
        Memory.
    least : float
        Least probability.
    out : (≥ MAX_POLYGONS,) int
        Out.
    """
    n = 0
    for t in range(MAX_POLYGONS):
        track = s[0].polygons[t]
        if (track.status != FREE and track.marks != 0) or is_sure_polygon(track, least):
            out[n] = t
            n += 1
    return n
