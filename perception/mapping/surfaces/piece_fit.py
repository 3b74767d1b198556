"""Where echoes of a piece came from, the line that fits them best, and whether a round object would fit better."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.mapping.surfaces.cells import lay_arc, share_of
from perception.mapping.surfaces.parameters import REACH_M, SAMPLES, WHOLE
from perception.mapping.surfaces.records import FREE, CellCounts, LocalMap
from perception.records import Records

OWN_SHARE_MIN: Final = 0.3
"""An echo is from a piece if so much of it is shared to the piece's cells."""
ROUNDS: Final = 4
"""Rounds of the robust fit of a piece, each with new weights."""
SCALE_M: Final = 0.09
"""Errors beyond this count ever less (Geman-McClure): three times what a pose's error and a cell's size leave."""
SIGMA_MIN_M: Final = 0.01
"""Least standard deviation of a piece's echoes."""
ECHOES_A_PLACE: Final = 4.0
"""So many echoes of a piece say what one independent echo would: their poses err together."""


@kernel
def place_echo(room: LocalMap, counts: CellCounts, k: int, half: float) -> None:
    """Write to `room.points[k]` from which piece the echo of reading k came, `FREE` if from none, and where on it.

    Where: the mean of the echo's places on that piece, weighted by their shares, m. It needs the owners of the cells,
    as of the end of the phase GROW, and overwrites `counts.arc`. `half` is half of the beam's opening, rad.
    """
    q, point = room.readings[k], room.points[k]
    point.piece = FREE
    if q.range_m > REACH_M:
        return
    lay_arc(counts, q, half)
    most, piece = 0, FREE
    for n in range(SAMPLES):
        share = share_of(q, n)
        if share > most:
            owner = owner_at(room, counts, n)
            if owner >= 0:
                most, piece = share, owner
    if piece < 0:
        return
    total, x, y = 0.0, 0.0, 0.0
    for n in range(SAMPLES):
        share = share_of(q, n)
        if share > 0 and owner_at(room, counts, n) == piece:
            total += share
            x += share * counts.arc[n].x
            y += share * counts.arc[n].y
    if total >= OWN_SHARE_MIN * WHOLE:
        point.x, point.y, point.piece = x / total, y / total, piece


@kernel
def owner_at(room: LocalMap, counts: CellCounts, n: int) -> int:
    """Return the owner of the cell at a place on the arc that was laid."""
    at = counts.arc[n]
    if at.i < 0 or counts.index[at.i, at.j] == 0:
        return FREE
    return int(room.cells[counts.index[at.i, at.j] - 1].owner)


@kernel
def place_echoes(room: LocalMap, counts: CellCounts, begin: int, end: int, half: float) -> None:
    """Do what `place_echo` does for the readings from `begin` up to `end`, which does not count."""
    for k in range(begin, end):
        place_echo(room, counts, k, half)


@kernel
def group_echoes(rooms: Records[LocalMap], every: Records[CellCounts]) -> None:
    """Write which echoes came from each piece n: `counts.grouped` from `begins[n]` to `begins[n + 1]`."""
    room, counts = rooms[0], every[0]
    begins = counts.begins
    begins[:] = 0
    for k in range(room.swept):
        if room.points[k].piece >= 0:
            begins[room.points[k].piece + 2] += 1
    for n in range(2, len(begins)):
        begins[n] += begins[n - 1]
    for k in range(room.swept):
        piece = room.points[k].piece
        if piece >= 0:
            counts.grouped[begins[piece + 1]] = k
            begins[piece + 1] += 1


@kernel
def robust(error: float) -> tuple[float, float]:
    """Return the weight of an error (m) and what it adds to the sum of squares, m²."""
    share = 1.0 / (1.0 + error * error / (SCALE_M * SCALE_M))
    return share * share, error * error * share


@kernel
def fit_line(room: LocalMap, counts: CellCounts, number: int) -> float:
    """Fit a piece's line to its echoes, by robust least squares; return the sum of squares, m²."""
    piece = room.pieces[number]
    total = 0.0
    for _ in range(ROUNDS):
        w0, wu, wuu, wv, wuv, total, echoes = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for at in range(counts.begins[number], counts.begins[number + 1]):
            k = counts.grouped[at]
            dx, dy = room.points[k].x - piece.x, room.points[k].y - piece.y
            u, v = dx * piece.ux + dy * piece.uy, dy * piece.ux - dx * piece.uy
            weight, square = robust(v)
            w0 += weight
            wu += weight * u
            wuu += weight * u * u
            wv += weight * v
            wuv += weight * u * v
            total += square
            echoes += 1.0
        spread = wuu - wu * wu / w0 if w0 > 0.0 else 0.0
        piece.echoes = echoes
        if echoes < 3.0 or spread <= 0.0:
            break
        turn = (wuv - wu * wv / w0) / spread
        middle, offset = wu / w0, wv / w0
        variance = max(total / echoes, SIGMA_MIN_M**2) * ECHOES_A_PLACE
        piece.variance_across, piece.variance_turn = variance / w0, variance / spread
        piece.x += middle * piece.ux - offset * piece.uy
        piece.y += middle * piece.uy + offset * piece.ux
        piece.low -= middle
        piece.high -= middle
        c, s = math.cos(turn), math.sin(turn)
        piece.ux, piece.uy = c * piece.ux - s * piece.uy, c * piece.uy + s * piece.ux
    return total


@kernel
def fit_circle(room: LocalMap, counts: CellCounts, number: int, radius: float) -> float:
    """Return the sum of squares (m²) of a circle of this radius at its best place, behind a piece's echoes."""
    piece = room.pieces[number]
    side = 0.0
    for at in range(counts.begins[number], counts.begins[number + 1]):
        q = room.readings[counts.grouped[at]]
        side += 1.0 if (q.y - piece.y) * piece.ux - (q.x - piece.x) * piece.uy < 0.0 else -1.0
    way = radius if side > 0.0 else -radius
    x, y = piece.x - way * piece.uy, piece.y + way * piece.ux
    total = 0.0
    for _ in range(ROUNDS):
        xx, xy, yy, ex, ey, total = 1e-9, 0.0, 1e-9, 0.0, 0.0, 0.0
        for at in range(counts.begins[number], counts.begins[number + 1]):
            k = counts.grouped[at]
            dx, dy = room.points[k].x - x, room.points[k].y - y
            away = max(math.hypot(dx, dy), 1e-6)
            error = away - radius
            weight, square = robust(error)
            nx, ny = dx / away, dy / away
            xx += weight * nx * nx
            xy += weight * nx * ny
            yy += weight * ny * ny
            ex += weight * nx * error
            ey += weight * ny * error
            total += square
        det = xx * yy - xy * xy
        if det <= 1e-12:
            break
        x += (yy * ex - xy * ey) / det
        y += (xx * ey - xy * ex) / det
    return total


@kernel
def judge(room: LocalMap, counts: CellCounts, number: int, radii: Floats) -> None:
    """Fit a piece and write its evidence: how much better its line fits than any of some circles.

    Parameters
    ----------
    room, counts
        The map, updated, and its counts, with its echoes grouped.
    number : int
        The piece's.
    radii : (k,) float
        Radii of the circles, m.
    """
    piece = room.pieces[number]
    line = fit_line(room, counts, number)
    if piece.echoes < 3.0:
        piece.evidence = -1.0
        return
    circle = math.inf
    for k in range(len(radii)):
        circle = min(circle, fit_circle(room, counts, number, radii[k]))
    variance = max(min(line, circle) / piece.echoes, SIGMA_MIN_M**2)
    piece.evidence = (circle - line) / (2.0 * variance * ECHOES_A_PLACE)
