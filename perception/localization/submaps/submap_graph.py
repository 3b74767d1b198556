"""Drift without known objects: maps of a few metres of way as landmarks, matched with each other.

Within a map odometry is taken as good. Each map that ends is compared with those that overlap it, joined in runs of
consecutive ones; the graph of all poses and the odometry's scales follow from the matches. The ring's pose is that of
the last map and the way since then by odometry. A firing is only taken down; all else is done in quanta, the steps of
a job that can be repeated: a snapshot holds only their number.

Odometry is exact until refuted: nothing is corrected before the matches are likelier by `REFUTED` with drift.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import IDENTITY, Firing, Pose, wrap_angle
from perception.bounds import CONSTANT, COUNT, FINITE, PLACE, POSITIVE, bounds, up_to
from perception.kernel import Floats
from perception.localization.localized_pose import KnownWay, LocalizedPose, Moment, Status
from perception.localization.submaps.held_maps import HeldMaps
from perception.localization.submaps.map_job import RUN_MAX, Maps, Outcome, match_map
from perception.localization.submaps.pose_graph import OF_OTHER, SCALES, Link, Node
from perception.localization.submaps.submap_records import (
    PATH_PLACES,
    SUBMAP_M,
    SUBMAP_RAD,
    SUBMAP_READINGS_MAX,
    Rows,
    Submap,
    between,
    compose,
    fresh_sensors,
    node_at,
    odometry_link,
    pose_of,
    scaled,
    spread_about,
    spread_beyond,
)
from perception.map_moves import MapMoves
from perception.records import zeros
from perception.sensor_mounts import mounts_array, mounts_at
from perception.shared_numbers import READING_M, READING_RAD

WALK_RAD: Final = 0.02
"""Random walk of odometry's heading beside the scales, rad/√m."""
WALK_M: Final = 0.03
"""Random walk of odometry's place beside the scales, m/√m."""
TURN_WAY: Final = 0.3
"""A turn of 1 rad walks as so much way, m/rad."""
LEAST_VARIANCE: Final = 1e-5
"""Added to the variances of a displacement by odometry, m² and rad², so that none is zero."""
WAY_POSES: Final = 5
"""Poses of the map that goes on by which the known way is longer, `READING_M` apart."""
USUAL_LOG: Final = -0.7
"""Log likelihood of a known reading where maps fit, at the start."""
USUAL_READINGS: Final = 100.0
"""How many readings that is worth."""
REFUTED: Final = 3.0
"""Log likelihood by which matches refute odometry, nat, beyond `REFUTED_A_NUMBER` for each number they determine."""
REFUTED_A_NUMBER: Final = 0.55
"""What is fitted to noise gains ½ nat for each number that it determines, one a map at least. Of drives with exact
poses (4 real ones, 6 in buildings) no gain comes within 0.6 nat of that."""

GRIDS_MAX: Final = 250
"""Maps whose grids are kept, 79 MB in all: at most 750 m of way. An older one is made again where it is needed."""


class SubmapGraph:
    """The pose by maps of a few metres of way.

    Parameters
    ----------
    ring : RingConfig
        The sensors.

    Attributes
    ----------
    is_applied : bool
        Whether matches have refuted odometry, so that poses are corrected.
    """

    SCRATCH: Final = ("_grids", "_lines", "_job", "_ended_way", "_way")
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        _latest=PLACE._replace(infinite=True),
        _readings=PLACE._replace(infinite=True),
        _count=up_to(SUBMAP_READINGS_MAX),
        _here=PLACE,
        _begin=PLACE,
        _turned=PLACE,
        _trail=PLACE,
        _trail_count=up_to(SUBMAP_READINGS_MAX),
        _matched=COUNT,
        _quanta=COUNT,
        _brought=COUNT,
        _scales=FINITE,
        _usual=FINITE,
        _spread=POSITIVE,
    )

    def __init__(self, ring: RingConfig) -> None:
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._readings = np.zeros((SUBMAP_READINGS_MAX, 5))
        """Of the map that goes on: sensor's place and ring's direction by odometry, sensor's direction on the ring,
        range."""
        self.held = HeldMaps()
        """Where what is remembered of the maps stands."""
        self._trail = np.zeros((SUBMAP_READINGS_MAX, 5))
        """The ring's poses of the map that goes on, as of `_here`."""
        self.reset()

    def reset(self) -> None:
        """Start again: the next firing's odometry defines the map frame."""
        self._submaps, self._nodes, self._links = Rows(Submap), Rows(Node), Rows(Link)
        self._grids: dict[int, Floats] = {}
        self._lines: dict[int, Floats] = {}
        self._job: Iterator[Outcome | None] | None = None
        self._ended_way: tuple[tuple[int, ...], KnownWay] | None = None
        self._way: tuple[tuple[int, ...], KnownWay] | None = None
        """The known way until the last map ended, and with the map that goes on, each beside what it follows from."""
        self._readings[:] = self._trail[:] = 0.0
        self.held.reset()
        self._latest = np.full((len(self._mounts), 3), math.inf)
        """The ring's pose at each sensor's last reading of the map that goes on."""
        self._count = self._trail_count = 0
        self._here, self._turned = np.zeros(5), 0.0
        """The ring's pose by odometry, not wrapped, with way (m) and turns (rad) until there; and the direction of
        travel less the ring's, rad."""
        self._begin = np.zeros(2)
        """Way and turns until the map before ended."""
        self.is_applied = False
        self._matched, self._quanta, self._brought = 0, 0, 0
        """Maps that were compared with those before, quanta done of the next one, and maps as `moves` knew them."""
        self._scales, self._usual = np.zeros(SCALES), np.array([USUAL_LOG * USUAL_READINGS, USUAL_READINGS])
        self._spread = np.zeros(2)
        """Variance of place (m²) and direction (rad²) of the last map in the map frame."""

    def observe(self, firing: Firing) -> None:
        """Take down a firing with its pose by odometry."""
        x, y, yaw = firing.pose.x, firing.pose.y, firing.ring_yaw
        here = self._here
        if self._trail_count == 0 and len(self._submaps.archived_rows) == 0:  # the first one
            here[:3] = x, y, yaw
        turn = wrap_angle(yaw - here[2])
        here[3] += math.hypot(x - here[0], y - here[1])
        here[4] += abs(turn)
        here[:3], self._turned = (x, y, here[2] + turn), firing.pose.theta - yaw
        self._take_down(firing)
        way, turns = (here[3:] - self._begin).tolist()
        if way >= SUBMAP_M or turns >= SUBMAP_RAD or self._count > SUBMAP_READINGS_MAX - len(self._mounts):
            self._end_map()

    def _take_down(self, firing: Firing) -> None:
        here, ranges = self._here, firing.ranges_m
        last = self._trail[self._trail_count - 1]
        if self._trail_count == 0 or (_is_apart(here - last) and self._trail_count < SUBMAP_READINGS_MAX):
            self._trail[self._trail_count] = here
            self._trail_count += 1
        fresh = fresh_sensors(ranges, here[:3], self._latest)
        if fresh.any():
            mounts = mounts_at(firing, self._mounts, self._turning)[fresh]
            c, s = math.cos(here[2]), math.sin(here[2])
            rows = self._readings[self._count : self._count + len(mounts)]
            rows[:, 0] = here[0] + c * mounts[:, 0] - s * mounts[:, 1]
            rows[:, 1] = here[1] + s * mounts[:, 0] + c * mounts[:, 1]
            rows[:, 2], rows[:, 3], rows[:, 4] = here[2], mounts[:, 2], ranges[fresh]
            self._count += len(mounts)
            self._latest[fresh] = here[:3]

    def _end_map(self) -> None:
        """End the map that goes on, and begin the next one."""
        middle = self._trail[self._trail_count // 2].copy()
        row = zeros(Submap, 1)
        row["pose"], row["way"], row["turn"], row["count"] = middle[:3], middle[3], middle[4], self._count
        rows = self._readings[: self._count]
        placed = scaled(between(middle, rows[:, :3]), self._scales)
        placed[:, 2] += rows[:, 3]
        row["readings"][0, : self._count] = np.column_stack([placed, rows[:, 4]])
        kept = np.linspace(0, self._trail_count - 1, PATH_PLACES).astype(np.int64)
        row["path"][0] = between(middle, self._trail[kept, :3])
        before = self._submaps.archived_rows
        self._submaps.append(row)
        if len(before) == 0:
            node = middle[:3]
        else:
            moved = between(before[-1]["pose"], middle)
            node = compose(pose_of(self._nodes.archived_rows[-1]), scaled(moved, self._scales))
            covariance = walk(moved, middle[3] - before[-1]["way"], middle[4] - before[-1]["turn"])
            information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
            link = odometry_link(len(before) - 1, moved, information)
            self._links.append(link)
            self._spread[:] = spread_beyond(self._spread, link, pose_of(self._nodes.archived_rows[-1]), node)
        self._nodes.append(node_at(node))
        self.held.append(node if self.held.is_moved else middle[:3])
        self._begin[:] = self._here[3:]
        self._latest[:] = math.inf
        self._count = self._trail_count = 0

    @property
    def can_refine(self) -> bool:
        """Whether a map waits to be compared with those before."""
        return self._matched < len(self._submaps.archived_rows)

    def refine(self) -> None:
        """Do one quantum."""
        if self._job is None:
            self._job = self._begin_job()
            for _ in range(self._quanta):  # of a snapshot
                next(self._job)
        self._quanta += 1
        outcome = next(self._job)
        if outcome is not None:
            self._take(outcome)

    def _begin_job(self) -> Iterator[Outcome | None]:
        """Return the work of matching the next map, on copies: what is driven meanwhile does not disturb it."""
        links = self._links.archived_rows
        maps = Maps(
            self._submaps.archived_rows[: self._matched + 1],
            self._nodes.archived_rows[: self._matched + 1].copy(),
            links[links["to"] <= self._matched],
            self._scales.copy(),
            self._usual.copy(),
            self._grids,
            self._lines,
        )
        return match_map(maps, self._half_angle)

    def _take(self, outcome: Outcome) -> None:
        """Use what the comparison of a map has given; maps that have ended since then follow by odometry."""
        self._scales[:], self._usual[:] = outcome.scales, outcome.usual
        links, nodes = self._links.archived_rows, self._nodes.archived_rows
        later = links["to"] > self._matched
        self._links.archived_rows = np.concatenate([outcome.links, links[later]])
        nodes[: self._matched + 1] = outcome.nodes
        for k in range(self._matched + 1, len(nodes)):
            poses = self._submaps.archived_rows["pose"]
            moved = scaled(between(poses[k - 1], poses[k]), self._scales)
            nodes[k : k + 1] = node_at(compose(pose_of(nodes[k - 1]), moved))
        numbers = max(outcome.determined, self._matched)
        self.is_applied = self.is_applied or outcome.gain > REFUTED + REFUTED_A_NUMBER * numbers
        self._matched += 1
        self._quanta, self._job = 0, None
        for cache, count in ((self._grids, GRIDS_MAX), (self._lines, RUN_MAX + 1)):
            for number in list(cache)[:-count]:
                del cache[number]
        self._spread[:] = spread_about(0, self._links.archived_rows, self._nodes.archived_rows)[-1]

    @property
    def count(self) -> int:
        """The number of maps that have ended."""
        return len(self._submaps.archived_rows)

    def moves(self) -> MapMoves | None:
        """Return how what is remembered of the maps moves since it was asked last; None where it stays."""
        if not self.is_applied or self._brought == self._matched:
            return None
        self._brought, nodes = self._matched, self._nodes.archived_rows
        poses = np.column_stack([nodes["x"], nodes["y"], nodes["theta"]])
        return self.held.move_to(poses, self._submaps.archived_rows["way"])

    def in_filter(self) -> Floats:
        """Return the ring's pose at the last firing in the filter's frame, x, y (m) and direction (rad)."""
        moment = self.moment()
        return self.held.in_filter(self.placed(moment)) if self.held.is_moved else moment.odometry

    def odometry_from_filter(self) -> Pose:
        """Return the pose of the filter's frame in odometry's frame, at the last firing."""
        if not self.held.is_moved:
            return IDENTITY
        return Pose(*self.moment().odometry.tolist()).compose(Pose(*self.in_filter().tolist()).inverse())

    def drop_caches(self) -> None:
        """Forget what follows from the rest, after a snapshot was put back."""
        self._grids, self._lines, self._job, self._ended_way, self._way = {}, {}, None, None, None

    def moment(self) -> Moment:
        """Return the moment of the last firing, for `placed`."""
        return Moment(len(self._submaps.archived_rows), self._here[:3].copy(), self._turned)

    def placed(self, moment: Moment) -> Floats:
        """Return the ring's pose in the map frame at a moment, as known now, x, y (m) and direction (rad)."""
        return self._placed(moment.submap, moment.odometry)

    def _placed(self, submap: int, odometry: Floats) -> Floats:
        """Return in the map frame poses (…, 3) that odometry gives while the robot is in this map of the way."""
        submaps = self._submaps.archived_rows
        if not self.is_applied or len(submaps) == 0:
            return odometry
        number = min(submap, len(submaps) - 1)
        moved = scaled(between(submaps[number]["pose"], odometry), self._scales)
        return compose(pose_of(self._nodes.archived_rows[number]), moved)

    def known_way(self) -> KnownWay:
        """Return the way as known now, in the map frame; only matches that the others bear out.

        It is the same object until some poses more are known, or a map.
        """
        maps = self._matched, self.count
        if self._ended_way is None or self._ended_way[0] != maps:
            self._ended_way = maps, self._way_of_maps()
        state, ended = (*maps, self._trail_count // WAY_POSES), self._ended_way[1]
        if self._way is None or self._way[0] != state:
            here = self._placed(self.count, self._trail[: self._trail_count, :3])
            self._way = state, ended._replace(path=np.concatenate([ended.path, here[:, :2]]))
        return self._way[1]

    def _way_of_maps(self) -> KnownWay:
        """Return the way until the last map ended: its cost grows with the way, so it is asked for once a map."""
        nodes, links, submaps = self._nodes.archived_rows, self._links.archived_rows, self._submaps.archived_rows
        maps = np.zeros((len(nodes), 5))
        maps[:, 0], maps[:, 1] = nodes["x"], nodes["y"]
        if len(nodes):
            maps[:, 2] = maps[:, 4] = 0.5 * spread_about(0, links, nodes)[:, 0]
        is_loop = (links["is_match"] != 0) & (links["by_scale"][:, OF_OTHER] != 0.0).any(axis=1)
        loops = links[is_loop & (links["weight"] > 0.5)]
        x, y, _ = np.moveaxis(scaled(submaps["path"], self._scales), -1, 0)
        c, s = np.cos(nodes["theta"])[:, None], np.sin(nodes["theta"])[:, None]
        path = np.stack([nodes["x"][:, None] + c * x - s * y, nodes["y"][:, None] + s * x + c * y], axis=-1)
        ends = np.column_stack([maps[loops["of"], :2], maps[loops["to"], :2]])
        return KnownWay(path.reshape(-1, 2), maps, ends)

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing, in the map frame."""
        moment = self.moment()
        x, y, yaw = self.placed(moment).tolist()
        here = moment.odometry
        submaps = self._submaps.archived_rows
        start = submaps[-1] if len(submaps) else None
        way, turn = (self._here[3:] - (0.0 if start is None else (start["way"], start["turn"]))).tolist()
        moved = between(here if start is None else start["pose"], here)
        covariance = walk(moved, way, turn)
        covariance[:2, :2] += np.eye(2) * (self._spread[0] + self._spread[1] * (moved[0] ** 2 + moved[1] ** 2))
        covariance[2, 2] += self._spread[1]
        status: Status = "tracking" if self._matched > 0 else "localizing"
        return LocalizedPose(Pose(x, y, yaw + self._turned), yaw, covariance, status, 1.0)

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame, at the last firing."""
        if not self.is_applied:
            return IDENTITY
        moment = self.moment()
        return Pose(*moment.odometry.tolist()).compose(Pose(*self.placed(moment).tolist()).inverse())


def _is_apart(moved: Floats) -> bool:
    return math.hypot(moved[0], moved[1]) >= READING_M or abs(moved[2]) >= READING_RAD


def walk(moved: Floats, way: float, turn: float) -> Floats:
    """Return the covariance of a motion by odometry beside its scales, shape (3, 3).

    Parameters
    ----------
    moved : (3,) float
        x, y (m) and direction (rad) of its end in the frame of its begin.
    way, turn : float
        Length (m) and turns (rad) of it. The heading walks evenly along it.
    """
    place = WALK_M**2 * way + LEAST_VARIANCE
    heading = WALK_RAD**2 * (way + TURN_WAY * turn) + LEAST_VARIANCE
    lever = np.array([-0.5 * moved[1], 0.5 * moved[0], 1.0])
    covariance = heading * np.outer(lever, lever)
    covariance[0, 0] += place + heading * way * way / 12.0
    covariance[1, 1] += place + heading * way * way / 12.0
    return covariance
