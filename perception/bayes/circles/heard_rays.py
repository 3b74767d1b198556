"""By how many rays the bodies of a place are heard, decided for all of them at once.

How a beam answers is a property of the sonar, not of a body. So it is a hypothesis of the place: nearest points, or a
number of rays (`perception.bayes.inference.beam`). A body that fails as it is heard here is tried by another number
of rays, and where it leads by far, all bodies together decide.
"""

from __future__ import annotations

from typing import Final

from perception.bayes.circles.alternatives import fit_other_circle, fit_other_line, mean_bearing, score
from perception.bayes.inference.beam import assume_rays, next_rays
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.occlusion import keep_relevant
from perception.bayes.inference.range_fit import fit_circle
from perception.bayes.inference.reservoir import add_crosses, copy_reservoir, gather_history
from perception.bayes.memory.parameters import (
    CIRCLE_EVIDENCE_MIN_NAT,
    CIRCLE_READINGS_MIN,
    FIRST_FIT_SOFTNESS,
    FIT_SOFTNESS,
    OTHER_FIT_STEPS,
    SWITCH_UNSEEN,
    TRACK_FIT_STEPS,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, RAYS_MAX, CircleTrack, CircleTracks, StateRecord
from perception.kernel import kernel

OTHER_RAYS_EVERY: Final = 6
"""One in so many bodies that fail is tried by other rays: 3 took 15 % of a firing among boxes, 6 took 2."""
RAYS_LEAD_NAT: Final = 55.0
"""Evidence that the sonar is of rays, or of another number of them. In halls by 1 to 3 rays a drum led by 70 to 160
nat; in halls by nearest points nothing led, among furniture what is no drum by up to 42, before the tracks spoke."""
LEAD_MAX_NAT: Final = 1000.0
"""Most that one body says against rays, and enough to ask no other."""


@kernel
def try_other_rays(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, kind: int) -> bool:
    """Try the scratch's hypothesis, which failed, by other rays; return whether the place is heard so from now on.

    While one number leads, the bodies that fail are all tried by it.
    """
    s[0].untried += 1
    if s[0].untried < OTHER_RAYS_EVERY:
        return False
    rays = s[0].tried_rays
    lead = lead_of_rays(s, tracks, p, kind, rays)
    if lead < CIRCLE_EVIDENCE_MIN_NAT:
        s[0].untried = 0
        s[0].tried_rays = next_rays(rays, s[0].rays)
    if lead >= RAYS_LEAD_NAT:
        for t in range(len(tracks)):
            if tracks[t].status == ESTABLISHED and lead > -LEAD_MAX_NAT:
                lead += lead_of_track(s, tracks, p, t, rays)
    assume_rays(s, p, s[0].rays)
    if lead < RAYS_LEAD_NAT:
        return False
    change_rays(s, tracks, p, rays)
    return True


@kernel
def lead_of_rays(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, kind: int, rays: int) -> float:
    """Return the lead of a circle heard by so many rays over all that explains its readings as heard here, nat.

    Parameters
    ----------
    s, tracks, p, kind
        As for `try_other_rays`.
    rays : int
        As in `State`.
    """
    scratch = s[0].scratch
    fit = scratch.circle_fit
    radius = p[0].circles[kind].radius_m
    noise = noise_variance(s, p)
    fit.x, fit.y = scratch.hypothesis.x, scratch.hypothesis.y
    assume_rays(s, p, rays)
    n = 0
    for turn in range(2):
        x, y = fit.x, fit.y
        n = keep_relevant(s, tracks, p, gather_history(s, p, x, y, radius), x, y, radius, -1)
        softness = FIT_SOFTNESS if turn == 1 else FIRST_FIT_SOFTNESS
        if n < CIRCLE_READINGS_MIN or not fit_circle(
            scratch.readings[:n], (x, y, radius), p, softness, noise, OTHER_FIT_STEPS, scratch.predicted, fit
        ):  # fmt: skip
            return 0.0
    x, y = fit.x, fit.y
    by_rays = score(s, p, n, x, y, radius)
    best = p[0].unknown_nat * scratch.score.near
    if scratch.score.hits < CIRCLE_READINGS_MIN or by_rays < max(best, CIRCLE_EVIDENCE_MIN_NAT):
        return 0.0
    bearing = mean_bearing(scratch.readings[:n], scratch.predicted, x, y, p[0].gate_m)
    assume_rays(s, p, s[0].rays)
    best = max(best, fit_other_line(s, p, n, (x, y, radius), bearing, OTHER_FIT_STEPS))
    for k in range(p[0].circle_count):
        other = p[0].circles[k].radius_m
        best = max(best, fit_other_circle(s, p, n, (x, y, radius), bearing, other, OTHER_FIT_STEPS))
    return by_rays - best


@kernel
def evidence_by_rays(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int, rays: int) -> float:
    """Return the evidence of the circle that best explains a track's readings, heard by so many rays, nat.

    Parameters
    ----------
    s, p, track
        Memory, settings, and the track.
    n : int
        Its readings, the first of the scratch, whose `predicted` is of the track.
    rays : int
        As in `State`.
    """
    scratch = s[0].scratch
    bearing = mean_bearing(scratch.readings[:n], scratch.predicted, track.x, track.y, p[0].gate_m)
    assume_rays(s, p, rays)
    best = -LEAD_MAX_NAT
    for k in range(p[0].circle_count):
        radius = p[0].circles[k].radius_m
        v = fit_other_circle(s, p, n, (track.x, track.y, track.radius), bearing, radius, TRACK_FIT_STEPS)
        best = max(best, v)
    return best


@kernel
def lead_of_track(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, t: int, rays: int) -> float:
    """Return how much likelier a track's readings are heard by so many rays than as heard here, nat.

    Parameters
    ----------
    s, tracks, p
        Memory, circles and settings.
    t : int
        The track.
    rays : int
        As in `State`.
    """
    track = tracks[t]
    n = copy_reservoir(track, s[0].scratch.readings)
    n = add_crosses(s, p, track.x, track.y, track.radius, s[0].scratch.readings, n)
    assume_rays(s, p, s[0].rays)
    n = keep_relevant(s, tracks, p, n, track.x, track.y, track.radius, t)
    here = score(s, p, n, track.x, track.y, track.radius)
    return evidence_by_rays(s, p, track, n, rays) - here


@kernel
def compare_rays(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> None:
    """Compare a track with the best circle heard by the next number of rays, on the same readings.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : CircleTrack
        Updated.
    n : int
        Its readings, the first of the scratch.
    """
    track.other_rays = next_rays(track.other_rays, s[0].rays)
    here = score(s, p, n, track.x, track.y, track.radius)
    track.rays_leads[track.other_rays] = evidence_by_rays(s, p, track, n, track.other_rays) - here
    assume_rays(s, p, s[0].rays)


@kernel
def decide_rays(s: StateRecord, tracks: CircleTracks, p: SettingsRecord) -> None:
    """Let the place be heard by that number of rays, if any, by which its objects together are likelier by far."""
    for k in range(RAYS_MAX + 1):
        lead = 0.0
        for t in range(len(tracks)):
            if tracks[t].status != FREE:
                lead += tracks[t].rays_leads[k]
        if k != s[0].rays and lead > RAYS_LEAD_NAT:
            change_rays(s, tracks, p, k)
            return


@kernel
def change_rays(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, rays: int) -> None:
    """Hear the place by another number of rays from now on; its objects are refined anew.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    rays : int
        As in `State`.
    """
    s[0].rays = rays
    assume_rays(s, p, rays)
    for t in range(len(tracks)):
        track = tracks[t]
        track.rays_leads[:] = 0.0
        if track.status != FREE:
            track.leads[:] = 0.0
            track.refinements = 0
            track.unseen += SWITCH_UNSEEN
