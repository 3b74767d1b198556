"""Where the ends of sure walls come to lie: at corners and edges that are heard, and which of these are reported."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.walls.contact import EDGE_SIGMA_M
from perception.bayes.walls.corners import ALONE_LEAD, CORNER_ECHOES_MIN, EDGE_ECHOES_MIN, EDGE_SAME_M
from perception.bayes.walls.crossing import CORNER_BEYOND_M, CORNER_INSIDE_M
from perception.bayes.walls.points import ECHOES_MIN
from perception.bayes.walls.straight import Straight
from perception.records import Structured

CORNER_NEAR_M: Final = 1.0
"""A corner this near to the ends of both its walls need not be heard."""
CORNER_PASSED_SHARE: Final = 0.2
"""No more than this share of the ranges towards a corner that was not heard went on."""
DOORWAY_MIN_M: Final = 1.05
"""A wall goes on to a corner of which it is the only known side if that is no farther than the narrowest doorway."""
EDGE_SIGMA_MAX_M: Final = 0.05
"""Greatest uncertainty of a sure edge."""
EDGE_LEAD_MIN: Final = 2.0
"""Least lead of echoes over passes, of an edge where a sure wall ends."""
EDGE_NEAR_M: Final = 0.18
"""Ranges that passed so near the end of a span, three bins, may have passed beyond the edge."""
ALONE_EDGE_ECHOES: Final = 5.0
"""Least echoes of an edge between mirrors that is sure whatever is known of its walls. Other points need
`ECHOES_MIN`; an edge is heard from near alone."""
ROUGH_LEAD: Final = 5.0
"""Where slanting walls answer, the echoes of such a point are more than so many times its passes: some of them may be
a wall's."""
ONE_WAY_NAT_MAX: Final = 1.0
"""Greatest log odds of such an edge. In the rooms of `bench standing` four of seven were true."""
EVIDENCE_MAX_NAT: Final = 12.0
"""Greatest evidence that is believed, of which each echo of a point is one: readings are not independent."""


def _is_proven(corner: np.void, passes: float, *, are_mirrors: bool) -> bool:
    """Return whether its echoes from afar prove a corner, whatever is known of its walls."""
    far = float(corner["far_echoes"])
    lead = ALONE_LEAD if are_mirrors else ROUGH_LEAD
    return far >= ECHOES_MIN and far > lead * passes and bool(corner["is_edge"] != are_mirrors)


def _end_near(places: list[tuple[float, float, tuple[int, int]]]) -> bool:
    """Return whether two walls end near their corner, which is at these places of theirs."""
    return len(places) == 2 and max(gap for _, gap, _ in places) < CORNER_NEAR_M


def _extend(owners: list[Straight], places: list[tuple[float, float, tuple[int, int]]], *, is_reached: bool) -> bool:
    """Move the ends of walls to their corner if it `is_reached` from near it; return whether all end there."""
    are_met = True
    for owner, (along, gap, at) in zip(owners, places, strict=True):
        end = owner.ends[at]
        if is_reached and -CORNER_INSIDE_M < gap < CORNER_BEYOND_M and not owner.is_passed(along, end):
            owner.ends[at] = along
        are_met = are_met and abs(owner.ends[at] - along) < EDGE_SAME_M
    return are_met


def reach_corners(walls: dict[int, Straight], corners: Structured, are_mirrors: bool) -> list[tuple[float, ...]]:
    """Move the ends of walls to the corners in which they end, unless ranges passed there.

    A corner that is heard is reached from afar; one that is not, only if both walls end near it. Between mirrors only
    an inside corner answers from afar, and elsewhere only an edge: that one is sure whatever is known of its walls.

    Parameters
    ----------
    walls : dict of Straight
        The walls by their number; their ends are updated.
    corners : (n,) record of `RoomCorner`
        All corners.
    are_mirrors : bool
        Whether the walls are known to be mirrors.

    Returns
    -------
    list of tuple
        The corners that are sure, as `CornerPoint` has them.
    """
    found = []
    for corner in corners[corners["is_used"] == 1]:
        x, y, echoes, passes, ended = (float(corner[name]) for name in ("x", "y", "echoes", "passes", "ended"))
        owners = [walls[number] for number in (int(corner["first"]), int(corner["second"])) if number in walls]
        places = [owner.beyond(x, y) for owner in owners]
        is_heard = echoes >= CORNER_ECHOES_MIN and echoes > passes
        is_near = _end_near(places) and passes < CORNER_PASSED_SHARE * ended
        is_met = _extend(owners, places, is_reached=is_heard or is_near) and len(owners) == 2
        # Ranges that end at both walls speak for their corner, whether it answers or not.
        signs = max(echoes, CORNER_PASSED_SHARE * ended)
        is_kept = corner["is_kept"] == 1 and signs > passes
        is_sure = is_kept or _is_proven(corner, passes, are_mirrors=are_mirrors)
        if is_sure or (is_met and (is_heard or is_near)):
            found.append(_point(corner, signs if is_kept or (is_met and is_near) else echoes))
    return found


def _ends_at(owner: Straight, edge: Structured, echoes: float) -> bool:
    """Move the end of a wall to an edge that is its own, unless ranges passed there; return whether it ends there."""
    along, side = owner.along(float(edge["x"]), float(edge["y"])), int(edge["second"])
    reach = EDGE_SAME_M if edge["is_edge"] == 1 else DOORWAY_MIN_M
    beyond = (along - owner.ends[:, side]) * (2 * side - 1)
    span = int(np.abs(beyond).argmin())
    is_own = -EDGE_SAME_M < beyond[span] < reach and (owner.ends[span, 1 - side] < along) == bool(side)
    is_near = bool(abs(beyond[span]) < EDGE_NEAR_M)
    if not is_own or not (is_near or echoes >= EDGE_ECHOES_MIN):
        return False
    if not is_near and owner.is_passed(along, owner.ends[span, side]):
        return False
    owner.ends[span, side] = along
    return True


def end_at_edges(walls: dict[int, Straight], edges: Structured, are_mirrors: bool) -> list[tuple[float, ...]]:
    """Move the ends of walls to the edges that are heard there.

    Parameters
    ----------
    walls : dict of Straight
        The walls by their number; their ends are updated.
    edges : (n,) record of `RoomCorner`
        All edges.
    are_mirrors : bool
        Whether the walls are known to be mirrors; an edge is heard from near then.

    Returns
    -------
    list of tuple
        The edges that are sure, as `CornerPoint` has them.
    """
    found = []
    for edge in edges[edges["is_used"] == 1]:
        echoes, passes, owner = float(edge["echoes"]), float(edge["passes"]), walls.get(int(edge["first"]))
        if are_mirrors and edge["is_edge"] == 1:
            echoes -= float(edge["far_echoes"])
        variance = float(edge["covariance_xx"] + edge["covariance_yy"])
        is_kept = bool(edge["is_kept"] == 1 and edge["echoes"] > passes)
        if not is_kept and (echoes - passes < EDGE_LEAD_MIN or variance > EDGE_SIGMA_MAX_M**2):
            continue
        least = ALONE_EDGE_ECHOES if are_mirrors and edge["is_edge"] == 1 else ECHOES_MIN
        is_sure = is_kept or (echoes >= least and echoes > (ALONE_LEAD if are_mirrors else ROUGH_LEAD) * passes)
        if owner is not None and _ends_at(owner, edge, echoes):
            is_sure = True
        if is_sure:
            found.append(_point(edge, float(edge["echoes"])))
    return found


def is_one_way(heard: Structured) -> bool:
    """Return whether a point's echoes place it along one direction only; they are a record of `PointInformation`."""
    xx, xy, yy = (float(heard[name]) for name in ("xx", "xy", "yy"))
    return 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy) < 1.0 / EDGE_SIGMA_M**2


def _point(corner: Structured, signs: float) -> tuple[float, ...]:
    """Return a corner as `CornerPoint` has it; `signs` of it, as an echo is one, against the ranges that passed."""
    log_odds = signs - float(corner["passes"])
    place = (float(corner[name]) for name in ("x", "y", "covariance_xx", "covariance_xy", "covariance_yy"))
    greatest = ONE_WAY_NAT_MAX if corner["is_edge"] == 1 and is_one_way(corner["heard"]) else EVIDENCE_MAX_NAT
    clipped = min(max(log_odds, -EVIDENCE_MAX_NAT), greatest)
    return (*place, int(corner["is_edge"]), float(corner["echoes"]), clipped)
