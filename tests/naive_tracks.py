"""Slow, readable oracles of how the Bayesian method keeps its tracks, walls and noise: plain Python, in metres.

They share no code with the product; constants are repeated.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests import naive_bayes
from tests.naive_bayes import Noise

Array = NDArray[Any]
FT = 0.3048
SILENT = 1e6


def rows(readings: Iterable[Sequence[float] | Array]) -> list[tuple[float, ...]]:
    """Return readings as sorted tuples, to be compared without regard to their order."""
    return sorted(tuple(float(v) for v in row) for row in readings)


class Reservoir:
    """The newest readings of each direction, seen from an object."""

    def __init__(self, bins: int, capacity: int) -> None:
        self.kept = [deque[tuple[float, ...]](maxlen=capacity) for _ in range(bins)]

    def put(self, centre: Array, q: Array) -> None:
        bearing = math.atan2(q[1] - centre[1], q[0] - centre[0])
        sector = math.floor((bearing + math.pi) / (2 * math.pi) * len(self.kept)) % len(self.kept)
        self.kept[sector].append(tuple(float(v) for v in q[:5]))


def off_axis(q: Array, place: Array) -> tuple[float, float]:
    """Return distance of a place and how far it lies along a reading's axis."""
    to = place - q[:2]
    return float(np.hypot(*to)), float(to @ q[2:4])


def gather(memory: Iterable[Array], centre: Array, rho: float, opt: float, reach: float) -> list[tuple[float, ...]]:
    """Return the remembered readings that look towards a circle within reach."""
    found = []
    for q in memory:
        d, ahead = off_axis(q, centre)
        if ahead > 0 and ahead >= opt * d - 0.02 * FT and d - rho <= reach:
            found.append(q[:5])
    return rows(found)


def towards(w: Array, centre: Array, rho: float, gate: float) -> Array:
    """Return the mean unit direction to a circle's centre from the sensors that hear it."""
    seen = naive_bayes.look(w, centre)
    total = seen.u[np.abs(w[:, 4] - (seen.d - rho)) < gate].sum(0)
    return np.asarray(total / np.hypot(*total)) if total.any() else np.zeros(2)


def roughness(
    a: Array, b: Array, c: Array, now: float, gap: float, half_box: float, noises: Array, heard: Array
) -> Array:  # fmt: skip
    """Return the evidence for each noise after three readings: the middle one against the chord of the outer two."""
    way = np.cumsum([0.0, math.dist(c[:2], b[:2]), math.dist(b[:2], a[:2])])
    if max(b[4], c[4]) >= SILENT or now - c[5] > gap or not 0 < way[2] <= FT:
        return heard
    e = b[4] - np.interp(way[1], way[[0, 2]], [c[4], a[4]])
    shares = np.array([way[1], way[2] - way[1]]) / way[2]
    var = (1 + shares @ shares) * (noises[:, 0] ** 2 + (noises[:, 1] * b[4]) ** 2 + half_box**2 / 3) + 1e-4 * FT**2
    bell = np.exp(-(e**2) / (2 * var)) / np.sqrt(2 * math.pi * var)
    return np.asarray(0.997 * heard + np.log(0.8 * bell + 0.02 / FT))


def likeliest_noise(rough: Array, residual: Array, gate: float) -> int:
    """Return the likeliest of the noises that roughness does not rule out."""
    return int(np.argmax(np.where(rough > rough.max() - gate, rough + residual, -np.inf)))


def residual_evidence(
    w: Array, centre: Array, rho: float, half: float, gate: float, noises: Sequence[Noise]
) -> list[float]:  # fmt: skip
    """Return the evidence of an object's residuals for each noise."""
    seen = naive_bayes.look(w, centre)
    e = w[:, 4] - (seen.d - rho)
    use = (np.abs(e) < gate) & (seen.cos >= half)
    return [float(naive_bayes.evidence(noise, w[use, 4], e[use]).sum()) for noise in noises]


def place_readings(
    last: dict[int, Array], stands: dict[int, tuple[int, int]], mounts: Array, pose: tuple[float, float, float],
    ranges: Array, span: tuple[float, float], half_box: float, sigma: tuple[float, float],
) -> list[tuple[float, ...]]:  # fmt: skip
    """Return the new readings of this firing in the odometry's frame: x, y, axis, range, sensor.

    The least range of the span is said of all that is nearer, so it is none.
    Of those from one place the first is new. Where the sensor began, and after three in turn that differ from the
    first one, or one more for each doubling of those before, the first, second, fourth and eighth are.
    """
    turn = np.array([[math.cos(pose[2]), -math.sin(pose[2])], [math.sin(pose[2]), math.cos(pose[2])]])
    new = []
    for i, (mount, r) in enumerate(zip(mounts, ranges, strict=True)):
        if not r >= 0:
            continue
        q = np.array([
            *(np.array(pose[:2]) + turn @ mount[:2]), *(turn @ [math.cos(mount[2]), math.sin(mount[2])]),
            2 * SILENT if r >= span[1] else r,
        ])  # fmt: skip
        old = last.get(i)
        moved = math.inf if old is None or q[2:4] @ old[2:4] <= 0.9998 else math.dist(q[:2], old[:2])
        looks, differ = stands.get(i, (0, 0))
        if old is not None and moved < 0.005:
            var = sigma[0] ** 2 + (sigma[1] * min(q[4], old[4])) ** 2 + half_box**2 / 3 + 1e-6 * FT**2
            differ = differ + 1 if abs(q[4] - old[4]) > 2 * half_box + 3 * math.sqrt(2 * var) else 0
            is_changed = differ >= 3 + math.log2(max(1, looks + 1 - differ))
            stands[i] = (1, 0) if is_changed else (looks + 1, differ)
            if stands[i][0] not in (1, 2, 4, 8):
                continue
        elif old is not None and moved < 0.05 * FT and abs(q[4] - old[4]) <= half_box:
            continue
        else:
            stands[i] = (1, 0) if old is None else (9, 0)
        if stands[i][0] in (1, 9):
            last[i] = q
        if r > span[0] + half_box:
            new.append((*q, float(i)))
    return new


def partners(
    i: int, cur: Array, memories: Sequence[list[Array]], now: float, gap: float
) -> list[Array]:  # fmt: skip
    """Return the readings paired with reading i: of its own sensor at three baselines, then of its neighbours."""
    q, sensor, found = cur[i], int(cur[i][5]), []
    wanted = [0.5 * FT, 1.0 * FT, 2.0 * FT]
    for old in reversed(memories[sensor]):
        base = math.dist(q[:2], old[:2])
        if now - old[5] > gap or not wanted or (base > 2.6 * FT):
            break
        if base >= wanted[0]:
            found.append(old)
            wanted.pop(0)
    for neighbour in ((sensor - 1) % len(memories), (sensor + 1) % len(memories)):
        if not memories[neighbour]:
            continue
        together = [other for other in cur if int(other[5]) == neighbour]
        if together:
            if neighbour == (sensor + 1) % len(memories):
                found.append(together[0])
            continue
        old = memories[neighbour][-1]
        if now - old[5] < gap and 0.3 * FT < math.dist(q[:2], old[:2]) < 1.0 * FT:
            found.append(old)
    return [other for other in found if other[4] < SILENT]


def remembered(memory: list[Array], q: Array, now: float, spacing: float, gap: float, room: int) -> list[Array]:
    """Return the newest `room` readings of a sensor after a reading, which is left out if near in place and time."""
    if memory and math.dist(memory[-1][:2], q[:2]) < spacing and now - memory[-1][5] < gap:
        return memory
    return [*memory, np.array([*q[:5], now])][-room:]


def bears_on(
    q: Array, centre: Array, rho: float, free: bool, ours: bool, opt: float, inside: float, gate: float, reach: float
) -> bool:  # fmt: skip
    """Return whether a reading supports a circle (its own hit) or contradicts it (through it, or free and short)."""
    d, ahead = off_axis(q, centre)
    if ahead <= 0 or ahead < opt * d - 0.01 * FT:
        return False
    e = q[4] - (d - rho)
    if abs(e) <= gate:
        return ours
    return ahead >= inside * d and (d <= reach if e > 0 else free)


def claimed_by(q: Array, tracks: Iterable[tuple[int, Array, float, float]], opt: float, half_box: float,
               sigma: tuple[float, float]) -> int:  # fmt: skip
    """Return the track (number, centre, radius, σ) that explains a reading best, −1 without one."""
    fits = []
    for t, centre, rho, root in tracks:
        d, ahead = off_axis(q, centre)
        e = abs(q[4] - (d - rho))
        noise = math.sqrt(sigma[0] ** 2 + half_box**2 / 3 + 1e-6 * FT**2 + (sigma[1] * d) ** 2)
        if ahead > 0 and ahead >= opt * d - 0.004 * FT and e < half_box + 3 * noise + 2 * root:
            fits.append((e, t))
    return min(fits)[1] if fits and q[4] < SILENT else -1


def after_merging(
    t: int, live: Array, place: Array, rho: Array, llr: Array, merge: float, marked: Array, number: Array
) -> tuple[Array, Array]:
    """Return which tracks are left after t was compared with the others in turn, and their numbers.

    Of two in one place the one that a user marked stays, else the one with more evidence, with the older number.
    """
    live, number = live.copy(), number.copy()
    for k in np.flatnonzero(live):
        if k != t and math.dist(place[k], place[t]) < max(merge, 0.8 * max(rho[k], rho[t])):
            loser = t if (bool(marked[k]), float(llr[k])) > (bool(marked[t]), float(llr[t])) else k
            if not marked[k] and not marked[t]:
                number[k + t - loser] = min(number[k], number[t])
            live[loser] = False
            if loser == t:
                break
    return live, number


def next_in_turn(
    live: Array, fresh: Array, kept: Array, sigma: Array, likely: Array, owed: Array, away: Array, passed: Array,
    threshold: float, reach: float,
) -> tuple[int, Array]:  # fmt: skip
    """Return the track to refine, −1 without one, and which tracks wait.

    The value is the share of unseen readings, four times that where the track is uncertain, and above the threshold
    where final refinements are due; at the end of the reach half of it counts. A track that was passed over more than
    sixty times comes first.
    """
    worth = fresh / (kept + 8.0) * np.where((sigma > 0.03 * FT) | (likely < 0.95), 4.0, 1.0) + owed * (
        threshold + 1e-6
    )
    waits = live & (worth > threshold)
    if not waits.any():
        return -1, waits
    order = np.where(passed > 60, 1e9 + passed, worth * reach / (reach + away))
    return int(np.argmax(np.where(waits, order, -np.inf))), waits


def probability(
    own: float, known: bool, prior: float, general: float, unknown: float, leads: dict[int, float], outline: float,
    radius: float, models: int, line: int,
) -> float:  # fmt: skip
    """Return a track's share among all explanations, each weighted by its evidence and its prior."""

    def weight(nat: float) -> float:
        return math.exp(float(np.clip(nat, -60.0, 60.0)))

    bonus = prior if known else 0.0
    total = 1.0 + weight(-own - bonus) + weight(unknown + general - own - bonus)
    total += weight(outline - general) if known and outline != 0.0 else 0.0
    if known and radius > 0.0:
        rivals = sum(weight(lead - general) for k, lead in leads.items() if models <= k < line)
        total += max(0.0, weight(radius - general) - rivals)
    for k, lead in leads.items():
        theirs = prior if k < models else general + 1.0 if k == line else 0.0
        total += weight(lead + theirs - bonus)
    return 1.0 / total


def fate(
    state: int, llr: float, unknown: float, probability: float, hits: float, dispersion: float, sigma: float,
    spread: float,
) -> int:  # fmt: skip
    """Return a track's next status: 0 free, 1 tentative, 2 established."""
    if llr < 0 or llr < unknown - 6:
        return 0
    if state == 1:
        sure = probability > 0.7 and hits >= 8 and dispersion >= spread and sigma < 0.25 * FT
        return 2 if sure else 1
    return 1 if probability < 0.2 or dispersion < 0.5 * spread else 2
