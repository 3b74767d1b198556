"""The graph of the maps' poses: odometry from one to the next, matches between them, and the odometry's scales.

Unknown are the pose of each map, and by how much odometry is long in its way and its turns. What is likeliest is
found by Gauss-Newton steps, each a linear system that conjugate gradients solve (Hestenes and Stiefel 1952) without a
matrix: the work grows with the number of links, and can stop after any iteration and go on later. A match may be
wrong: it counts by Cauchy's density (Agarwal et al., "Robust map optimization using dynamic covariance scaling", ICRA
2013, weigh alike), so that a wrong one loses its weight as others contradict it.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from perception.bounds import COUNT, FINITE, Finite, Flag, Place
from perception.kernel import Floats, kernel
from perception.records import Record, Records

SCALES: Final = 4
"""Unknowns beside the poses: shares by which way and turns are longer than by odometry, and by which a match with the
map before, and one with another, has lost way, because what comes into view fits less well."""
OF_ODOMETRY: Final = 2
"""The first so many of them are odometry's."""
OF_OTHER: Final = 3
"""The one of matches with another map than the one before."""
GRAPH_SCALE_SIGMAS: Final = (0.03, 0.03, 0.01, 0.01)
"""Standard deviation of each before any match. What a match may lose and the scale of odometry look alike along a
way: with 0.03 for both, half of an odometry that is 3 % long counted as lost, and the error at the end of drives out
and back in three buildings was twice as great; with 0.005 it is the same as with 0.01."""
CAUCHY: Final = 2.0
"""A match that is off by so many standard deviations counts half."""


class Link(Record):
    """What is known of the pose of map `to` in the frame of map `of`."""

    of: Annotated[int, COUNT]
    to: Annotated[int, COUNT]
    is_match: Flag
    """Or odometry."""
    pose: Annotated[Floats, 3, FINITE]
    """x, y (m) and direction (rad); of odometry with its scales at 0."""
    by_scale: Annotated[Floats, SCALES, 3, FINITE]
    """Its derivatives by the scales."""
    information: Annotated[Floats, 3, 3, FINITE]
    """The inverse of its covariance."""
    weight: Finite
    """Of a match, by Cauchy's density; 1 for odometry."""


class Node(Record):
    """The pose of a map in the map frame."""

    x: Place
    y: Place
    theta: Place


@kernel
def linearise(
    links: Records[Link], count: int, nodes: Records[Node], scales: Floats, jacobians: Floats, residuals: Floats
) -> float:
    """Compute residuals and derivatives of all links, and the weights of matches.

    Parameters
    ----------
    links : (m,) Link
        Their weights are updated.
    count : int
        How many there are.
    nodes : (n,) Node
        Poses.
    scales : (SCALES,) float
        As they are.
    jacobians : (m, 3, 6 + SCALES) float
        Overwritten: by the pose of `of`, that of `to`, and the scales.
    residuals : (m, 3) float
        Overwritten.

    Returns
    -------
    float
        Minus the log density of the matches but for a constant.
    """
    cost = 0.0
    for m in range(count):
        link = links[m]
        a, b = nodes[link.of], nodes[link.to]
        c, s = math.cos(a.theta), math.sin(a.theta)
        dx, dy = b.x - a.x, b.y - a.y
        r, j = residuals[m], jacobians[m]
        r[0], r[1], r[2] = c * dx + s * dy, c * dy - s * dx, b.theta - a.theta
        for i in range(3):
            r[i] -= link.pose[i]
            for k in range(SCALES):
                r[i] -= scales[k] * link.by_scale[k, i]
        r[2] = (r[2] + math.pi) % (2.0 * math.pi) - math.pi
        j[:] = 0.0
        j[0, 0], j[0, 1], j[0, 2], j[0, 3], j[0, 4] = -c, -s, c * dy - s * dx, c, s
        j[1, 0], j[1, 1], j[1, 2], j[1, 3], j[1, 4] = s, -c, -c * dx - s * dy, -s, c
        j[2, 2], j[2, 5] = -1.0, 1.0
        for i in range(3):
            for k in range(SCALES):
                j[i, 6 + k] = -link.by_scale[k, i]
        link.weight = 1.0
        if link.is_match:
            chi = 0.0
            for i in range(3):
                for k in range(3):
                    chi += r[i] * link.information[i, k] * r[k]
            link.weight = 1.0 / (1.0 + chi / CAUCHY**2)
            cost += 0.5 * CAUCHY**2 * math.log1p(chi / CAUCHY**2)
    return cost


@kernel
def multiply(links: Records[Link], count: int, jacobians: Floats, given: Floats, result: Floats) -> None:
    """Multiply the normal matrix of all links with a vector.

    Parameters
    ----------
    links, count, jacobians
        As of `linearise`.
    given : (SCALES + 3 n,) float
        Scales, then x, y, direction of each node.
    result : (SCALES + 3 n,) float
        Overwritten. The first node is held: its rows are 0.
    """
    result[:] = 0.0
    for k in range(SCALES):
        result[k] = given[k] / GRAPH_SCALE_SIGMAS[k] ** 2
    for m in range(count):
        of, to, j, weight = SCALES + 3 * links[m].of, SCALES + 3 * links[m].to, jacobians[m], links[m].weight
        information = links[m].information
        moved0 = moved1 = moved2 = 0.0
        for k in range(3):
            moved0 += j[0, k] * given[of + k] + j[0, 3 + k] * given[to + k]
            moved1 += j[1, k] * given[of + k] + j[1, 3 + k] * given[to + k]
            moved2 += j[2, k] * given[of + k] + j[2, 3 + k] * given[to + k]
        for k in range(SCALES):
            moved0 += j[0, 6 + k] * given[k]
            moved1 += j[1, 6 + k] * given[k]
            moved2 += j[2, 6 + k] * given[k]
        for i in range(3):
            force = information[i, 0] * moved0 + information[i, 1] * moved1 + information[i, 2] * moved2
            force *= weight
            for k in range(3):
                result[of + k] += j[i, k] * force
                result[to + k] += j[i, 3 + k] * force
            for k in range(SCALES):
                result[k] += j[i, 6 + k] * force
    for k in range(3):
        result[SCALES + k] = 0.0


@kernel
def begin_step(
    links: Records[Link],
    count: int,
    scales: Floats,
    jacobians: Floats,
    residuals: Floats,
    vectors: Floats,
) -> None:
    """Begin a Gauss-Newton step.

    Parameters
    ----------
    links, count, scales, jacobians, residuals
        As of `linearise`.
    vectors : (6, SCALES + 3 n) float
        Overwritten: the step (0 so far), what is left of the gradient, the direction of search, its product with the
        matrix, the matrix's diagonal, and what is left divided by that.
    """
    vectors[:] = 0.0
    left, diagonal = vectors[1], vectors[4]
    for k in range(SCALES):
        left[k], diagonal[k] = -scales[k] / GRAPH_SCALE_SIGMAS[k] ** 2, 1.0 / GRAPH_SCALE_SIGMAS[k] ** 2
    for m in range(count):
        link, j, r = links[m], jacobians[m], residuals[m]
        for column in range(6 + SCALES):
            at = column - 6 if column >= 6 else SCALES + 3 * (link.to if column >= 3 else link.of) + column % 3
            for i in range(3):
                force = slope = 0.0
                for k in range(3):
                    force += link.information[i, k] * r[k]
                    slope += link.information[i, k] * j[k, column]
                left[at] -= link.weight * j[i, column] * force
                diagonal[at] += link.weight * j[i, column] * slope
    for k in range(SCALES, SCALES + 3):
        left[k], diagonal[k] = 0.0, 1.0
    for k in range(len(left)):
        vectors[5, k] = vectors[2, k] = left[k] / diagonal[k]


@kernel
def go_on(links: Records[Link], count: int, jacobians: Floats, vectors: Floats, iterations: int) -> float:
    """Do some iterations of conjugate gradients.

    Parameters
    ----------
    links, count, jacobians, vectors
        As of `begin_step`; the vectors are updated.
    iterations : int
        How many at most.

    Returns
    -------
    float
        The norm of what is left, by the inverse of the diagonal.
    """
    step, left, direction, product, diagonal, scaled = (
        vectors[0],
        vectors[1],
        vectors[2],
        vectors[3],
        vectors[4],
        vectors[5],
    )
    norm = 0.0
    for k in range(len(left)):
        norm += left[k] * scaled[k]
    for _ in range(iterations):
        multiply(links, count, jacobians, direction, product)
        curvature = 0.0
        for k in range(len(left)):
            curvature += direction[k] * product[k]
        if not curvature > 0.0:
            return 0.0
        share, after = norm / curvature, 0.0
        for k in range(len(left)):
            step[k] += share * direction[k]
            left[k] -= share * product[k]
            scaled[k] = left[k] / diagonal[k]
            after += left[k] * scaled[k]
        for k in range(len(left)):
            direction[k] = scaled[k] + after / norm * direction[k]
        norm = after
    return norm


@kernel
def spread_from(links: Records[Link], count: int, nodes: Records[Node], spread: Floats) -> None:
    """Compute how uncertain each map lies to one of them, along the best way of links: at most so much.

    Parameters
    ----------
    links, count, nodes
        As of `linearise`.
    spread : (n, 2) float
        Variance of place (m²) and direction (rad²): 0 for that one, infinite for all others. Overwritten.
    """
    for _ in range(len(spread)):
        has_changed = False
        for back in range(count):
            link = links[count - 1 - back]
            determinant = link.information[0, 0] * link.information[1, 1] - link.information[0, 1] ** 2
            place = (link.information[0, 0] + link.information[1, 1]) / max(determinant, 1e-9)
            turn = 1.0 / max(link.information[2, 2], 1e-9)
            if link.is_match:
                place, turn = place / max(link.weight, 1e-3), turn / max(link.weight, 1e-3)
            a, b = nodes[link.of], nodes[link.to]
            lever = (a.x - b.x) ** 2 + (a.y - b.y) ** 2
            for way in range(2):
                of, to = (link.of, link.to) if way else (link.to, link.of)
                far = spread[of, 0] + place + spread[of, 1] * lever
                if far + spread[of, 1] + turn < spread[to, 0] + spread[to, 1]:
                    spread[to, 0], spread[to, 1] = far, spread[of, 1] + turn
                    has_changed = True
        if not has_changed:
            return
