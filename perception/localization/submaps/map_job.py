"""The comparison of a map with those before it, and what follows from it for all: a job in steps of bounded work."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from drivers.messages import wrap_angle
from perception.kernel import Floats
from perception.localization.submaps.line_pairs import moved_lines, with_lines
from perception.localization.submaps.local_grid import (
    SUBMAP_CELLS,
    add_map,
    answers_of,
    make_grid,
)
from perception.localization.submaps.map_lines import find_lines
from perception.localization.submaps.map_match import Match, best_match
from perception.localization.submaps.pose_graph import (
    GRAPH_SCALE_SIGMAS,
    OF_ODOMETRY,
    SCALES,
    Link,
    Node,
    begin_step,
    go_on,
    linearise,
)
from perception.localization.submaps.submap_records import between, match_link, pose_of, spread_about, unlost
from perception.records import Structured, records, zeros

OVERLAP_M: Final = 6.0
"""Maps nearer to each other than this may overlap."""
RUN_MAX: Final = 8
"""Maps that are joined to be compared with."""
MATCH_M: Final = 0.04
"""Error of a match's place beside that of its readings."""
MATCH_RAD: Final = 0.02
"""Error of a match's heading beside that of its readings."""
FREE_INFORMATION: Final = 25.0
"""A direction known to 0.2 m, or 0.2 rad, counts for half, and less for less: where readings leave it nearly free,
all matches draw maps together. Along a bare corridor of 60 m the way then errs by 0.5 m, not by 2."""
KNOWN_MIN: Final = 20.0
"""Known readings that a match needs."""
MISFIT_MAX: Final = 0.5
"""By how much a reading of a match may be less likely than is usual, nat."""
MATCH_GATE: Final = 27.0
"""Squared deviation of a match from what was expected, over its covariance."""
SEARCH_REACH_M: Final = (0.3, 1.2)
"""Least and greatest distance from what is expected at which a match is looked for."""
SEARCH_REACH_RAD: Final = (0.1, 0.3)
"""Least and greatest turn from what is expected at which a match is looked for."""
SEARCH_REACH_SIGMAS: Final = 2.5
"""Between these limits, a match is looked for up to so many standard deviations."""
EXPECTED_LEAST: Final = (0.01, 0.01, 0.001)
"""Added to the variance of what is expected, m² and rad²: the search is coarse."""
GRAPH_STEPS_MAX: Final = 6
"""Gauss-Newton steps after a map, at most."""
ITERATIONS: Final = 24
"""Iterations of such a step in one quantum."""
LOST_STEPS: Final = 5
"""Steps in which the way that matches have lost is found, odometry exact."""
SOLVED: Final = 1e-6
"""A linear system is solved where the residual is this share of the right side."""
STEP_MIN: Final = 1e-4
"""A Gauss-Newton step in which nothing changes by as much, m or rad, is the last one."""


class Maps(NamedTuple):
    """What a job begins with: the maps up to the one to be compared, which is the last."""

    submaps: Structured
    nodes: Structured
    links: Structured
    scales: Floats
    usual: Floats
    """Sum of the log likelihoods of known readings where maps fitted, and their number, shape (2,)."""
    grids: dict[int, Floats]
    """Hits and passes of maps by number, shape (2, SUBMAP_CELLS, SUBMAP_CELLS) each, the last used at the end."""
    lines: dict[int, Floats]
    """Lines of maps by number, as of `map_lines.find_lines`, the last used at the end."""


class Outcome(NamedTuple):
    """What a job ends with."""

    nodes: Structured
    links: Structured
    scales: Floats
    usual: Floats
    gain: float
    """Log likelihood of the matches with drift less that without."""
    determined: float
    """How many numbers of the maps' poses follow from matches, and not from odometry."""


def match_map(maps: Maps, half_angle: float) -> Iterator[Outcome | None]:
    """Compare the last map with those before; yield None after each quantum, and the outcome last."""
    number = len(maps.submaps) - 1
    count = int(maps.submaps[number]["count"])
    readings = np.ascontiguousarray(maps.submaps[number]["readings"][:count])
    for grid in make_grid(readings, half_angle):
        maps.grids[number] = grid
        yield None
    for lines in find_lines(readings, half_angle):
        maps.lines[number] = lines
        yield None
    nodes, links, usual = maps.nodes, maps.links, maps.usual.copy()
    spread = spread_about(number, links, nodes)
    here = pose_of(nodes[number])
    distances = np.hypot(nodes["x"][:number] - here[0], nodes["y"][:number] - here[1])
    found: list[Structured] = []
    for run in _runs(np.flatnonzero(distances < OVERLAP_M).tolist()) if count else ():
        nearest = min(run, key=lambda k: distances[k])
        joined = np.zeros((2, SUBMAP_CELLS, SUBMAP_CELLS))
        for member in run:
            x, y, theta = between(pose_of(nodes[nearest]), pose_of(nodes[member])).tolist()
            hits, passes = _kept(maps.grids, maps, member, make_grid, half_angle)
            add_map(hits, passes, x, y, theta, joined[0], joined[1])
            yield None
        answers = np.empty((2, SUBMAP_CELLS, SUBMAP_CELLS))
        answers_of(joined[0], joined[1], answers[0], answers[1])
        expected = between(pose_of(nodes[nearest]), here)
        place, turn = spread[nearest].tolist()
        beam = np.array([half_angle, usual[0] / usual[1]])
        match: Match | None = None
        for match in best_match(
            readings,
            answers,
            beam,
            expected,
            _reach(place, turn),
            np.diag(1.0 / (np.array([place, place, turn]) + EXPECTED_LEAST)),
        ):
            if match is None:
                yield None
        if match is None:
            continue
        log_likelihood = match.log_likelihood + match.known * beam[1]
        is_next = number - 1 in run
        if is_next:
            usual += log_likelihood, match.known
        pose, by_lost = unlost(match.pose, is_next=is_next)
        off = pose - expected
        off[2] = wrap_angle(off[2])
        own = np.diag([MATCH_M**2, MATCH_M**2, MATCH_RAD**2])
        chi = off @ np.linalg.inv(np.linalg.inv(match.information) + own + np.diag([place, place, turn])) @ off
        misfit = usual[0] / usual[1] - log_likelihood / max(match.known, 1.0)
        if match.known < KNOWN_MIN or misfit > MISFIT_MAX or chi > MATCH_GATE:
            continue
        information = np.linalg.inv(np.linalg.inv(_firm(match.information)) + own)
        if is_next:  # loops find walls from both sides, and as they were bent by the drift between
            before = []
            for member in run:
                lines = _kept(maps.lines, maps, member, find_lines, half_angle)
                before.append(moved_lines(lines, between(pose_of(nodes[nearest]), pose_of(nodes[member]))))
                yield None
            of_cells = information
            pose, information = with_lines(np.concatenate(before), maps.lines[number], pose, of_cells)
            by_lost = np.asarray(np.linalg.solve(information, of_cells @ by_lost), dtype=np.float64)
            yield None
        found.append(match_link(nearest, number, pose, by_lost, information, is_next=is_next))
    links = np.concatenate([links, *found])
    solved = maps._replace(nodes=nodes, links=links, usual=usual)
    yield from _solve(solved, is_new=len(found) > 0)


def _firm(information: Floats) -> Floats:
    """Return the information (3, 3) of a match that counts; see `FREE_INFORMATION`."""
    values, axes = np.linalg.eigh(information)
    return np.asarray((axes * (values * values / (values + FREE_INFORMATION))) @ axes.T, dtype=np.float64)


def _kept(
    cache: dict[int, Floats],
    maps: Maps,
    number: int,
    make: Callable[[Floats, float], Iterator[Floats]],
    half_angle: float,
) -> Floats:
    """Return what was made of the readings of a map before; made again at once if it is no longer kept."""
    kept = cache.pop(number, None)
    if kept is None:
        submap = maps.submaps[number]
        *_, kept = make(np.ascontiguousarray(submap["readings"][: submap["count"]]), half_angle)
    cache[number] = kept
    return kept


def _runs(numbers: Sequence[int]) -> list[list[int]]:
    """Return runs of consecutive maps: odometry places those of one run well to each other."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1 and len(runs[-1]) < RUN_MAX:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs


def _reach(place: float, turn: float) -> Floats:
    reach_m = min(max(SEARCH_REACH_M[0], SEARCH_REACH_SIGMAS * math.sqrt(place)), SEARCH_REACH_M[1])
    return np.array(
        [reach_m, reach_m, min(max(SEARCH_REACH_RAD[0], SEARCH_REACH_SIGMAS * math.sqrt(turn)), SEARCH_REACH_RAD[1])]
    )


def _solve(maps: Maps, *, is_new: bool) -> Iterator[Outcome | None]:
    """Find the likeliest poses and scales; yield None after each quantum, and the outcome last."""
    links, nodes, scales = records(Link, maps.links), records(Node, maps.nodes), maps.scales.copy()
    count, size = len(maps.links), SCALES + 3 * len(maps.nodes)
    jacobians, residuals, vectors = np.empty((count, 3, 6 + SCALES)), np.empty((count, 3)), np.empty((6, size))
    at_odometry = _cost_at_odometry(maps, jacobians, residuals)
    for _ in range(GRAPH_STEPS_MAX if is_new else 0):
        linearise(links, count, nodes, scales, jacobians, residuals)
        begin_step(links, count, scales, jacobians, residuals, vectors)
        least = SOLVED**2 * max(1.0, float(vectors[1] @ vectors[5]))
        for _ in range(0, size, ITERATIONS):
            left = go_on(links, count, jacobians, vectors, ITERATIONS)
            yield None
            if left <= least:
                break
        step = vectors[0]
        scales += step[:SCALES]
        for k, name in enumerate(("x", "y", "theta")):
            maps.nodes[name] += step[SCALES + k :: 3]
        if np.abs(step).max() < STEP_MIN:
            break
    off = scales / GRAPH_SCALE_SIGMAS
    cost = linearise(links, count, nodes, scales, jacobians, residuals) + 0.5 * float(off @ off)
    of_odometry = maps.links["is_match"] == 0
    off = residuals[of_odometry]
    cost += 0.5 * float(np.einsum("ij,ijk,ik->", off, maps.links["information"][of_odometry], off))
    yield None
    yield Outcome(maps.nodes, maps.links, scales, maps.usual, at_odometry - cost, _determined(maps.links))


def _determined(links: Structured) -> float:
    """Return how many numbers of the maps' poses follow from matches with earlier maps, and not from odometry."""
    is_match = links["is_match"] != 0
    by_odometry, matches = links[~is_match], links[is_match]
    known = np.zeros((1 + int(links["to"].max(initial=0)), 3, 3))
    np.add.at(known, matches["to"], matches["weight"][:, None, None] * matches["information"])
    known = known[by_odometry["to"]]
    return float(np.trace(known @ np.linalg.inv(known + by_odometry["information"]), axis1=1, axis2=2).sum())


def _cost_at_odometry(maps: Maps, jacobians: Floats, residuals: Floats) -> float:
    """Return the cost of the matches where odometry is exact, and they have lost as much way as suits them best."""
    exact, scales, links = zeros(Node, len(maps.nodes)), np.zeros(SCALES), maps.links
    exact["x"], exact["y"], exact["theta"] = maps.submaps["pose"].T
    by_scale = links["by_scale"][:, OF_ODOMETRY:]
    prior = np.diag(1.0 / np.square(GRAPH_SCALE_SIGMAS[OF_ODOMETRY:]))
    cost = math.inf
    for _ in range(LOST_STEPS):
        cost = linearise(records(Link, links), len(links), records(Node, exact), scales, jacobians, residuals)
        lost = scales[OF_ODOMETRY:]
        cost += 0.5 * float(lost @ prior @ lost)
        force = np.einsum("n,nki,nij->nkj", links["weight"], by_scale, links["information"])
        slope = np.einsum("nkj,nj->k", force, residuals) - prior @ lost
        lost += np.linalg.solve(np.einsum("nkj,nlj->kl", force, by_scale) + prior, slope)
    return cost
