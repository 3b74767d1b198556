"""Hypotheses of the ring's pose: a Rao-Blackwellised particle filter whose samples are headings.

At a given heading the ranges are nearly linear in the place, while in the heading their likelihood has steps, because
a turn moves echoes into beams and out of them. So each particle is one history of headings, and carries the place and
the scale of the odometer as a Gaussian that is updated in closed form (Doucet, de Freitas, Murphy and Russell,
"Rao-Blackwellised particle filtering for dynamic Bayesian networks", 2000). Particles are grouped into hypotheses:
one for each place at which the robot may be. They are resampled within a hypothesis only, so that chance never
decides between two places that look alike. `perception.localization.known_room.particle_update` enters readings.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias

from perception.bounds import Finite, Place, Share, up_to
from perception.kernel import Floats, Ints, kernel
from perception.localization.known_room.surroundings import insert_nearest
from perception.records import Record, Records
from perception.shared_numbers import ODOMETER_SIGMA

HEADINGS: Final = 25
"""Particles of a hypothesis."""
HYPOTHESES_MAX: Final = 100
"""Hypotheses of the place at a time: the best starts of a search."""
PLACE_WALK: Final = 0.02**2
"""Variance of a displacement by odometry on each axis, m²/m."""
SCALE_WALK: Final = 0.002**2
"""Variance by which the scale changes, 1/m."""
HEADING_WALK: Final = math.radians(0.7) ** 2
"""Variance of the heading by odometry, rad²/m. Where few sensors hear something, a walk twice that of the
odometry makes the heading worse than the odometry leaves it."""
TURN_SHARE: Final = 0.02
"""Standard deviation of a turn by odometry as a share of it."""
TURN_WALK: Final = 0.0005
"""Variance of a turn by odometry beyond that, rad²/rad: an error of scale adds up over many turns to one side."""
SHARE_TEMPER: Final = 0.5
"""Weight of log evidence between hypotheses: places that look alike differ by what is common to many readings."""
RESAMPLE_SHARE: Final = 0.5
"""Particles are resampled where fewer than this share of them carry the weight."""
MERGE_M: Final = 0.3
"""Hypotheses nearer to each other than this, in heading than `MERGE_RAD`, are one."""
MERGE_RAD: Final = math.radians(10.0)
"""Difference of headings in `MERGE_M`."""
SAME_PLACE_M: Final = 0.5
"""Hypotheses as near to the best one as this, in heading as `SAME_PLACE_RAD`, are of the same place."""
SAME_PLACE_RAD: Final = math.radians(15.0)
"""Difference of headings in `SAME_PLACE_M`."""


class Particle(Record):
    """A heading (rad), and the Gaussian of place (m) and scale of the odometer at it."""

    heading: Place
    x: Place
    y: Place
    scale: Place
    xx: Finite
    xy: Finite
    xs: Finite
    yy: Finite
    ys: Finite
    ss: Finite
    log_weight: Finite
    """nat; not normalised."""
    log_ratio: Finite
    """Log likelihood ratio of the readings of the last update to readings from anywhere, nat."""
    specular: Finite
    turned_away: Finite
    late: Finite
    wild: Finite
    beside: Finite
    could_beside: Finite
    """Causes of the readings of the last update, as in `mixed_reflection`, summed."""


class Hypothesis(Record):
    """A place at which the robot may be: its log evidence (nat) and mean pose (m, rad) when last summarised."""

    log_evidence: Finite
    x: Place
    y: Place
    heading: Place
    particles: Annotated[Records[Particle], HEADINGS]


class Best(Record):
    """The most likely hypothesis after an update: its share of the probability, mean and covariance."""

    share: Share
    x: Place
    y: Place
    heading: Place
    xx: Finite
    xy: Finite
    xh: Finite
    yy: Finite
    yh: Finite
    hh: Finite
    log_ratio: Finite
    specular: Finite
    turned_away: Finite
    late: Finite
    wild: Finite
    beside: Finite
    could_beside: Finite
    """Mean over its particles of their fields of the same name."""


class Hypotheses(Record):
    """All hypotheses; those beyond `count` are zero."""

    count: Annotated[int, up_to(HYPOTHESES_MAX)]
    best: Best
    hypotheses: Annotated[Records[Hypothesis], HYPOTHESES_MAX]


class ParticleScratch(Record):
    """Overwritten before each use."""

    weights: Annotated[Floats, HEADINGS]
    drawn: Annotated[Records[Particle], HEADINGS]
    order: Annotated[Ints, HYPOTHESES_MAX]
    keys: Annotated[Floats, HYPOTHESES_MAX]
    is_kept: Annotated[Ints, HYPOTHESES_MAX]


HypothesesRecord: TypeAlias = Records[Hypotheses]
"""As kernels take it: one record."""


@kernel
def add_hypothesis(
    of: HypothesesRecord, x: float, y: float, heading: float, place_sigma_m: float, heading_half_rad: float
) -> None:
    """Add a hypothesis around a pose of the ring; where there are too many already, do nothing.

    Parameters
    ----------
    of : (1,) Hypotheses
        Updated.
    x, y, heading : float
        The pose, m and rad.
    place_sigma_m, heading_half_rad : float
        Standard deviation of the place; half the width of the row of headings.
    """
    count = of[0].count
    if count == HYPOTHESES_MAX:
        return
    particles = of[0].hypotheses[count].particles
    for i in range(HEADINGS):
        p = particles[i]
        p.heading = heading + heading_half_rad * (2.0 * i / (HEADINGS - 1) - 1.0)
        p.x, p.y, p.scale = x, y, 1.0
        p.xx, p.xy, p.xs = place_sigma_m * place_sigma_m, 0.0, 0.0
        p.yy, p.ys, p.ss = place_sigma_m * place_sigma_m, 0.0, ODOMETER_SIGMA * ODOMETER_SIGMA
        p.log_weight, p.log_ratio = -math.log(HEADINGS), 0.0
        p.specular = p.turned_away = p.late = p.wild = p.beside = p.could_beside = 0.0
    of[0].count = count + 1


@kernel
def move(of: HypothesesRecord, forward_m: float, left_m: float, turn_rad: float, noise: Floats) -> None:
    """Follow odometry: a displacement in the ring's frame before it, and a turn of the ring.

    All hypotheses take the same random numbers, so that chance does not decide between two that are alike.

    Parameters
    ----------
    of : (1,) Hypotheses
        Updated.
    forward_m, left_m, turn_rad : float
        By odometry.
    noise : (HEADINGS,) float
        From the standard normal distribution.
    """
    way = math.hypot(forward_m, left_m)
    turn_sigma = TURN_SHARE * turn_rad
    sigma = math.sqrt(HEADING_WALK * way + TURN_WALK * abs(turn_rad) + turn_sigma * turn_sigma)
    for h in range(of[0].count):
        particles = of[0].hypotheses[h].particles
        for i in range(HEADINGS):
            p, wander = particles[i], sigma * noise[i]
            c, s = math.cos(p.heading + 0.5 * wander), math.sin(p.heading + 0.5 * wander)
            dx, dy = c * forward_m - s * left_m, s * forward_m + c * left_m
            p.x += p.scale * dx
            p.y += p.scale * dy
            p.xx += 2.0 * dx * p.xs + p.ss * dx * dx + PLACE_WALK * way
            p.xy += dx * p.ys + dy * p.xs + p.ss * dx * dy
            p.yy += 2.0 * dy * p.ys + p.ss * dy * dy + PLACE_WALK * way
            p.xs += p.ss * dx
            p.ys += p.ss * dy
            p.ss += SCALE_WALK * way
            p.heading += wander + turn_rad


@kernel
def normalise(of: HypothesesRecord, h: int, scratch: Records[ParticleScratch]) -> float:
    """Write the particles' weights within hypothesis `h` into the scratch; return its log evidence, nat."""
    particles, weights = of[0].hypotheses[h].particles, scratch[0].weights
    most, total = -math.inf, 0.0
    for i in range(HEADINGS):
        most = max(most, particles[i].log_weight)
    for i in range(HEADINGS):
        weights[i] = math.exp(particles[i].log_weight - most)
        total += weights[i]
    for i in range(HEADINGS):
        weights[i] /= total
    return most + math.log(total)


@kernel
def summarise(of: HypothesesRecord, scratch: Records[ParticleScratch]) -> int:
    """Compute log evidence and mean pose of each hypothesis; return the number of the most likely one."""
    best = 0
    for h in range(of[0].count):
        hypothesis = of[0].hypotheses[h]
        hypothesis.log_evidence = normalise(of, h, scratch)
        hypothesis.x = hypothesis.y = hypothesis.heading = 0.0
        for i in range(HEADINGS):
            p, weight = hypothesis.particles[i], scratch[0].weights[i]
            hypothesis.x += weight * p.x
            hypothesis.y += weight * p.y
            hypothesis.heading += weight * p.heading
        if hypothesis.log_evidence > of[0].hypotheses[best].log_evidence:
            best = h
    return best


@kernel
def copy_particle(source: Records[Particle], i: int, target: Records[Particle], k: int) -> None:
    """Copy a particle."""
    p, q = source[i], target[k]
    q.heading, q.x, q.y, q.scale = p.heading, p.x, p.y, p.scale
    q.xx, q.xy, q.xs, q.yy, q.ys, q.ss = p.xx, p.xy, p.xs, p.yy, p.ys, p.ss
    q.log_weight, q.log_ratio = p.log_weight, p.log_ratio
    q.specular, q.turned_away, q.late, q.wild = p.specular, p.turned_away, p.late, p.wild
    q.beside, q.could_beside = p.beside, p.could_beside


@kernel
def keep_marked(of: HypothesesRecord, scratch: Records[ParticleScratch]) -> None:
    """Keep the hypotheses that `is_kept` marks, in their order, and zero the others."""
    found, count = of[0].hypotheses, 0
    for h in range(of[0].count):
        if scratch[0].is_kept[h]:
            if count < h:
                for i in range(HEADINGS):
                    copy_particle(found[h].particles, i, found[count].particles, i)
                a, b = found[h], found[count]
                b.log_evidence, b.x, b.y, b.heading = a.log_evidence, a.x, a.y, a.heading
            count += 1
    for h in range(count, of[0].count):
        found[h].log_evidence = found[h].x = found[h].y = found[h].heading = 0.0
        for i in range(HEADINGS):
            p = found[h].particles[i]
            p.heading = p.x = p.y = p.scale = p.log_weight = p.log_ratio = 0.0
            p.specular = p.turned_away = p.late = p.wild = p.beside = p.could_beside = 0.0
            p.xx = p.xy = p.xs = p.yy = p.ys = p.ss = 0.0
    of[0].count = count


@kernel
def prune(of: HypothesesRecord, least_log: float, most: int, scratch: Records[ParticleScratch]) -> None:
    """Drop hypotheses that repeat a better one, or are less likely than the best by more than `least_log` nat.

    Parameters
    ----------
    of : (1,) Hypotheses
        Summarised; updated.
    least_log : float
        nat.
    most : int
        So many are kept at most.
    scratch : (1,) ParticleScratch
        Overwritten.
    """
    order, keys, is_kept = scratch[0].order, scratch[0].keys, scratch[0].is_kept
    found, ordered, kept = of[0].hypotheses, 0, 0
    for h in range(of[0].count):
        ordered = insert_nearest(order, keys, ordered, h, -found[h].log_evidence)
        is_kept[h] = 0
    for k in range(ordered):
        h = order[k]
        if keys[k] > keys[0] + least_log or kept == most:
            break
        is_new = True
        for j in range(k):
            other = order[j]
            turn = (found[h].heading - found[other].heading + math.pi) % (2.0 * math.pi) - math.pi
            away = math.hypot(found[h].x - found[other].x, found[h].y - found[other].y)
            is_new = is_new and not (is_kept[other] and away <= MERGE_M and abs(turn) <= MERGE_RAD)
        if is_new:
            is_kept[h] = 1
            kept += 1
    keep_marked(of, scratch)


@kernel
def resample(of: HypothesesRecord, scratch: Records[ParticleScratch]) -> None:
    """Draw particles anew within each hypothesis whose weight lies on few of them."""
    weights, drawn = scratch[0].weights, scratch[0].drawn
    for h in range(of[0].count):
        log_evidence, squares = normalise(of, h, scratch), 0.0
        for i in range(HEADINGS):
            squares += weights[i] * weights[i]
        if 1.0 / squares >= RESAMPLE_SHARE * HEADINGS:
            continue
        particles, i, below = of[0].hypotheses[h].particles, 0, weights[0]
        for k in range(HEADINGS):
            while i < HEADINGS - 1 and below < (k + 0.5) / HEADINGS:
                i += 1
                below += weights[i]
            copy_particle(particles, i, drawn, k)
        for k in range(HEADINGS):
            copy_particle(drawn, k, particles, k)
            particles[k].log_weight = log_evidence - math.log(HEADINGS)


@kernel
def conclude(of: HypothesesRecord, least_log: float, most: int, scratch: Records[ParticleScratch]) -> None:
    """After an update of all hypotheses, drop unlikely ones, resample, and write the most likely one to `best`.

    Arguments as of `prune`; there must be a hypothesis.
    """
    h, best = summarise(of, scratch), of[0].best
    normalise(of, h, scratch)
    best.log_ratio = best.specular = best.turned_away = best.late = best.wild = 0.0
    best.beside = best.could_beside = 0.0
    for i in range(HEADINGS):
        p, weight = of[0].hypotheses[h].particles[i], scratch[0].weights[i]
        best.log_ratio += weight * p.log_ratio
        best.specular += weight * p.specular
        best.turned_away += weight * p.turned_away
        best.late += weight * p.late
        best.wild += weight * p.wild
        best.beside += weight * p.beside
        best.could_beside += weight * p.could_beside
    prune(of, least_log, most, scratch)
    resample(of, scratch)
    h, near, total = summarise(of, scratch), 0.0, 0.0
    middle = of[0].hypotheses[h]
    for k in range(of[0].count):
        other = of[0].hypotheses[k]
        odds = math.exp(SHARE_TEMPER * (other.log_evidence - middle.log_evidence))
        turn = (other.heading - middle.heading + math.pi) % (2.0 * math.pi) - math.pi
        total += odds
        if math.hypot(other.x - middle.x, other.y - middle.y) <= SAME_PLACE_M and abs(turn) <= SAME_PLACE_RAD:
            near += odds
    normalise(of, h, scratch)
    best.share, best.x, best.y, best.heading = near / total, middle.x, middle.y, middle.heading
    best.xx = best.xy = best.xh = best.yy = best.yh = best.hh = 0.0
    for i in range(HEADINGS):
        p, weight = middle.particles[i], scratch[0].weights[i]
        dx, dy, turn = p.x - middle.x, p.y - middle.y, p.heading - middle.heading
        best.xx += weight * (p.xx + dx * dx)
        best.xy += weight * (p.xy + dx * dy)
        best.yy += weight * (p.yy + dy * dy)
        best.xh += weight * dx * turn
        best.yh += weight * dy * turn
        best.hh += weight * turn * turn
