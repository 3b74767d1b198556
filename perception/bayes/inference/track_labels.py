"""Numbers of tracks, which are free, and what a user confirmed, placed or rejected.

A track gets its number when it starts and keeps it; a user's mark on it lasts until it is withdrawn, however little
the readings say: the track yields to no alternative explanation, and to no other track in its place. Where a user
rejected an object, none like it starts before the new evidence exceeds that of the rejected one.
"""

from __future__ import annotations

import math

from perception.bayes.memory.elements import REJECTIONS_MAX
from perception.bayes.memory.parameters import APART_RADII, CENTRE_VARIANCE_MAX_M2
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import FREE, TENTATIVE, AnyTrack, CircleTrack, CircleTracks, StateRecord
from perception.kernel import kernel
from perception.records import Records


@kernel
def free_track(tracks: Records[AnyTrack]) -> int:
    """Return a free track, else the unmarked tentative one with the least evidence, else −1."""
    worst = math.inf
    slot = -1
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status == FREE:
            return t
        if track.status == TENTATIVE and track.log_likelihood_ratio < worst and track.marks == 0:
            worst = track.log_likelihood_ratio
            slot = t
    return slot


@kernel
def assign_number(s: StateRecord, track: AnyTrack) -> None:
    """Assign the next number to a new track, and clear its marks."""
    s[0].objects_numbered += 1
    track.number = s[0].objects_numbered
    track.marks = 0


@kernel
def clear_track(track: AnyTrack) -> None:
    """Set what all tracks have in common to zero, except number, marks and the readings in the bins."""
    track.status = FREE
    track.unseen = 0
    track.reservoir = 0
    track.refinements = 0
    track.idle_firings = 0
    track.final_refinements = 0
    track.passed_over = 0
    track.x = 0.0
    track.y = 0.0
    track.log_likelihood_ratio = 0.0
    track.hits = 0.0
    track.near = 0.0
    track.probability = 0.0
    for b in range(len(track.bins)):
        track.bins[b].count = 0


@kernel
def drop_track(track: AnyTrack) -> bool:
    """Free a track, or make it tentative where a user marked it; return whether it was freed."""
    if track.marks == 0:
        track.status = FREE
        return True
    track.status = TENTATIVE
    return False


@kernel
def outlives(track: AnyTrack, other: AnyTrack, has_more: bool) -> bool:
    """Return whether the first of two tracks in one place stays; the one that stays gets the older number.

    Parameters
    ----------
    track, other
        The tracks, updated. One that a user marked stays, and keeps its number.
    has_more : bool
        Whether the first has more evidence.
    """
    if (track.marks != 0) != (other.marks != 0):
        return track.marks != 0
    if track.marks == 0:
        older = min(track.number, other.number)
        if has_more:
            track.number = older
        else:
            other.number = older
    return has_more


@kernel
def hold(track: CircleTrack, x: float, y: float) -> None:
    """Leave a track that a user marked in its place, as uncertain as a user's: its readings do not support it.

    A track moves with each refinement, and without support it would follow the echoes of other bodies anywhere.
    """
    track.x = x
    track.y = y
    track.covariance_xx = CENTRE_VARIANCE_MAX_M2
    track.covariance_xy = 0.0
    track.covariance_yy = CENTRE_VARIANCE_MAX_M2


@kernel
def merge_duplicates(tracks: CircleTracks, p: SettingsRecord, t: int) -> None:
    """Merge a track with others in the same place: keep the one with more evidence, or the one that a user marked.

    A model that was reported, or confirmed, keeps its number, whichever of the two is older.
    """
    track = tracks[t]
    for k in range(len(tracks)):
        other = tracks[k]
        if k != t and other.status != FREE:
            apart = max(p[0].merge_m, APART_RADII * max(track.radius, other.radius))
            if math.hypot(other.x - track.x, other.y - track.y) < apart:
                lead = track.is_named + track.is_confirmed - other.is_named - other.is_confirmed
                named = track.number if lead > 0 else other.number
                is_one_named = lead != 0 and track.marks == 0 and other.marks == 0
                if outlives(other, track, other.log_likelihood_ratio > track.log_likelihood_ratio):
                    other.number = named if is_one_named else other.number
                    track.status = FREE
                    return
                track.number = named if is_one_named else track.number
                other.status = FREE


@kernel
def is_rejected(s: StateRecord, x: float, y: float, what: int, evidence_nat: float) -> bool:
    """Return whether a user rejected such an object at (x, y), and the evidence is too little to start it again.

    Parameters
    ----------
    s : (1,) State
        Memory.
    x, y : float
        m.
    what : int
        Index of a circle, or `POLYGON` plus that of a polygon model.
    evidence_nat : float
        Evidence for it.
    """
    for k in range(min(s[0].rejection_count, REJECTIONS_MAX)):
        it = s[0].rejections[k]
        if it.what == what and evidence_nat < it.evidence_nat and math.hypot(x - it.x, y - it.y) < it.radius:
            return True
    return False


@kernel
def may_become(s: StateRecord, track: CircleTrack, k: int, evidence_nat: float) -> bool:
    """Return whether a track may become another circle: neither a user's mark nor a rejection prevents it.

    Parameters
    ----------
    s, track
        Memory, in whose scratch the other circle is fitted, and the track.
    k : int
        Index of the other circle.
    evidence_nat : float
        Its evidence.
    """
    fit = s[0].scratch.circle_fit
    return track.marks == 0 and not is_rejected(s, fit.x, fit.y, k, evidence_nat)
