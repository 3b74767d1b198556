"""The map frame of perception: firings are entered at corrected poses, results are turned back to odometry's frame.

What perception holds is in the filter's frame, so that drift does not smear it; the map frame differs from that by a
turn and a shift (`perception.localization.drift.drift_correction`). Odometry's frame, in which the robot
drives, stays continuous whatever is corrected: there, the objects move.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final, TypeAlias

from config.model import ModelConfig
from config.robot import RingConfig
from drivers.messages import IDENTITY, Firing, Pose
from perception.detected_object import DetectedObject, turned_object, worst_sigma
from perception.edits import (
    Evidence,
    MarkVacant,
    MoveObject,
    ObjectRow,
    PlaceModel,
    RestoreArea,
    RestoreObjects,
    RestoreSegments,
)
from perception.kernel import Floats
from perception.localization.drift.drift_correction import DriftCorrection, LandmarkPlace, SeenObject
from perception.localization.localized_pose import KnownWay, LocalizedPose, Moment
from perception.localization.odometry_frame import AnyEdit, OdometryFrame
from perception.localization.submaps.submap_graph import SubmapGraph
from perception.map_moves import FollowsMaps
from perception.polyline import Polyline
from perception.vacant_areas import VacantArea

SHIFT_MIN_M: Final = 0.002
"""An object moves with its landmark once that has moved this far."""


class MapFrame(OdometryFrame):
    """Poses corrected by what is recognised, and conversions between the frames.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise; the round ones become landmarks.
    """

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig]) -> None:
        self.drift = DriftCorrection(ring)
        """The landmark filter."""
        self.submaps = SubmapGraph(ring)
        """The pose by maps of a few metres of way; of both, the first that refutes odometry corrects it."""
        self._near: set[int] = set()
        self.set_models(models)

    @property
    def is_applied(self) -> bool:
        """Whether odometry is refuted, so that poses are corrected."""
        return self.drift.is_applied

    @property
    def corrects_path(self) -> bool:
        """Whether earlier poses are corrected later, too: by maps of the way."""
        return self.submaps.is_applied

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Make landmarks of the round ones of these models."""
        self._radii = {model.name: model.arc_radius_m for model in models if model.arc_radius_m is not None}

    def reset(self) -> None:
        """Start again: the next firing's odometry defines the map frame."""
        self.drift.reset()
        self.submaps.reset()

    @property
    def can_refine(self) -> bool:
        """Whether the pose by maps waits for quanta."""
        return not self.drift.is_applied and self.submaps.can_refine

    def refine(self) -> int:
        """Do one quantum, and return 1."""
        self.submaps.refine()
        return 1

    def drop_caches(self) -> None:
        """Forget what follows from the rest, after a snapshot was put back."""
        self.submaps.drop_caches()

    def follow(
        self, firing: Firing, objects: Sequence[DetectedObject], shift: Callable[[int, float, float], object]
    ) -> Firing:
        """Return a firing at its pose in the filter's frame.

        Parameters
        ----------
        firing : Firing
            With its pose by odometry.
        objects : sequence of DetectedObject
            Recognised near the robot before it, in the filter's frame.
        shift : callable
            Called with number and displacement (m) of the objects that are to move, because their landmarks moved.
        """
        if self.submaps.is_applied:  # what seems round among walls may be a corner
            self.submaps.observe(firing)
            return self._in_filter(firing)
        self._near = {seen.number for seen in objects if seen.number is not None}
        self.drift.learn(
            SeenObject(seen.number, seen.x, seen.y, self._radii[seen.model])
            for seen in objects
            if seen.covariance is not None
            and seen.model in self._radii
            and not seen.placed
            and seen.number is not None
        )
        self.drift.observe(firing)
        if not self.drift.is_applied:
            self.submaps.observe(firing)
        for number, dx, dy in self.drift.moved_landmarks(SHIFT_MIN_M, self._near):
            shift(number, dx, dy)
        return self.drift.corrected(firing)

    def _in_filter(self, firing: Firing) -> Firing:
        """Return a firing where maps of the way have it."""
        if not self.submaps.held.is_moved:
            return firing
        x, y, yaw = self.submaps.in_filter().tolist()
        return replace(firing, pose=Pose(x, y, yaw + firing.pose.theta - firing.ring_yaw), ring_yaw=yaw)

    def _odometry_from_filter(self) -> Pose:
        """Return the pose of the filter's frame in odometry's frame, at the last firing."""
        return self.drift.odometry_from_filter() if self.drift.is_applied else self.submaps.odometry_from_filter()

    def move(self, memories: Iterable[FollowsMaps]) -> None:
        """Move what is remembered with the maps of the way."""
        moves = self.submaps.moves()
        for memory in memories:
            memory.follow_maps(self.submaps.count, moves)

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing: by landmarks where there are some, or by maps of the way."""
        if self.submaps.is_applied:
            return self.submaps.localized()
        here = self.drift.localized()
        if self.drift.is_applied or here.status != "localizing":
            return here
        return self.submaps.localized()._replace(pose=here.pose, ring_yaw=here.ring_yaw)

    def moment(self) -> Moment | None:
        """Return the moment of the last firing, for `as_known_now`; None where landmarks correct the pose."""
        return None if self.drift.is_applied else self.submaps.moment()

    def as_known_now(self, then: LocalizedPose, moment: Moment | None) -> LocalizedPose:
        """Return where the robot was at a moment, as known now; by landmarks that is what was known then."""
        if moment is None or not self.submaps.is_applied:
            return then
        x, y, yaw = self.submaps.placed(moment).tolist()
        return then._replace(pose=Pose(x, y, yaw + moment.turned), ring_yaw=yaw)

    def moved_since(self, moment: Moment) -> Pose:
        """Return the pose of odometry's frame of a moment in that of now, as known now."""
        if not self.submaps.is_applied:
            return IDENTITY
        then, at = Pose(*moment.odometry.tolist()), Pose(*self.submaps.placed(moment).tolist())
        return self.submaps.odometry_from_map().compose(at).compose(then.inverse())

    def known_way(self) -> KnownWay | None:
        """Return the way as known now, in the map frame; None where no map of it corrects odometry."""
        return self.submaps.known_way() if self.submaps.is_applied else None

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame, at the last firing."""
        return self.drift.odometry_from_map() if self.drift.is_applied else self.submaps.odometry_from_map()

    def in_map(self, objects: Iterable[DetectedObject]) -> tuple[DetectedObject, ...]:
        """Return objects of the filter's frame in the map frame."""
        if not self.drift.is_applied:
            to = self.submaps.odometry_from_map().inverse().compose(self._odometry_from_filter())
            return tuple(turned_object(to, seen) for seen in objects) if self.submaps.is_applied else tuple(objects)
        to = self.drift.map_from_filter()
        return tuple(turned_object(to, seen) for seen in self._with_landmarks(objects))

    def _with_landmarks(self, objects: Iterable[DetectedObject]) -> tuple[DetectedObject, ...]:
        """Return objects, of which those that are landmarks with the place that the filter gives them."""
        places = self.drift.places()
        return tuple(_placed(seen, places.get(seen.number or 0)) for seen in objects)

    def objects_in_odometry(self, objects: Iterable[DetectedObject]) -> tuple[DetectedObject, ...]:
        """Return objects of the filter's frame in odometry's frame."""
        to = self._odometry_from_filter()
        if not self.drift.is_applied:
            return tuple(objects) if to == IDENTITY else tuple(turned_object(to, seen) for seen in objects)
        return tuple(turned_object(to, seen) for seen in self._with_landmarks(objects))

    def polylines_in_odometry(self, polylines: tuple[Polyline, ...]) -> tuple[Polyline, ...]:
        """Return polylines of the filter's frame in odometry's frame."""
        to = self._odometry_from_filter()
        return polylines if to == IDENTITY else tuple(polyline.in_frame(to) for polyline in polylines)

    def segments_in_odometry(self, geometry: Floats) -> Floats:
        """Return segments in odometry's frame: ends x1, y1, x2, y2 (m) and normal (rad), shape (n, 5)."""
        to = self._odometry_from_filter()
        c, s = math.cos(to.theta), math.sin(to.theta)
        turned = geometry.copy()
        for x, y in ((0, 1), (2, 3)):
            turned[:, x] = to.x + c * geometry[:, x] - s * geometry[:, y]
            turned[:, y] = to.y + s * geometry[:, x] + c * geometry[:, y]
        turned[:, 4] += to.theta
        return turned

    def areas_in_odometry(self, areas: tuple[VacantArea, ...]) -> tuple[VacantArea, ...]:
        """Return vacant areas of the filter's frame in odometry's frame."""
        to = self._odometry_from_filter()
        places = [to.compose(Pose(area.x, area.y, 0.0)) for area in areas]
        return tuple(area._replace(x=at.x, y=at.y) for area, at in zip(areas, places, strict=True))

    def evidence_in_odometry(self, evidence: Evidence | None) -> Evidence | None:
        """Return the evidence for an object of the filter's frame in odometry's frame."""
        if evidence is None:
            return None
        to = self._odometry_from_filter()
        arcs = [(arc, to.compose(Pose(arc.x, arc.y, arc.direction))) for arc in evidence.arcs]
        lines = [
            (line, to.compose(Pose(line.x1, line.y1, 0.0)), to.compose(Pose(line.x2, line.y2, 0.0)))
            for line in evidence.lines
        ]
        return replace(
            evidence,
            arcs=tuple(
                replace(arc, x=at.x, y=at.y, direction=at.theta, listener=_moved(to, arc.listener))
                for arc, at in arcs
            ),
            lines=tuple(replace(line, x1=a.x, y1=a.y, x2=b.x, y2=b.y) for line, a, b in lines),
        )

    def edit_in_filter(self, edit: AnyEdit) -> AnyEdit:
        """Return an operator's edit, whose places are in odometry's frame, in the filter's frame."""
        to = self._odometry_from_filter().inverse()
        if isinstance(edit, RestoreSegments):
            return replace(edit, rows=tuple(_turned_row(to, row) for row in edit.rows))
        if isinstance(edit, RestoreObjects):
            return replace(edit, rows=tuple(_placed_row(to, row) for row in edit.rows))
        if isinstance(edit, MarkVacant | RestoreArea):
            centre = to.compose(Pose(edit.x, edit.y, 0.0))
            return replace(edit, x=centre.x, y=centre.y)
        if not isinstance(edit, PlaceModel | MoveObject):
            return edit
        place = to.compose(Pose(edit.x, edit.y, edit.theta))
        return replace(edit, x=place.x, y=place.y, theta=place.theta)


SegmentRow: TypeAlias = tuple[float, float, float, float, float, float, float, float]


def _moved(to: Pose, place: tuple[float, float] | None) -> tuple[float, float] | None:
    if place is None:
        return None
    at = to.compose(Pose(*place, 0.0))
    return at.x, at.y


def _turned_row(to: Pose, row: SegmentRow) -> SegmentRow:
    """Return a row of `RestoreSegments` in another frame, in which the present origin lies at `to`."""
    number, x1, y1, x2, y2, normal, time_s, pinned = row
    a, b = to.compose(Pose(x1, y1, normal)), to.compose(Pose(x2, y2, normal))
    return number, a.x, a.y, b.x, b.y, a.theta, time_s, pinned


def _placed_row(to: Pose, row: ObjectRow) -> ObjectRow:
    """Return an object's row in another frame, in which the present origin lies at `to`."""
    at = to.compose(Pose(row.x, row.y, row.theta))
    return row._replace(x=at.x, y=at.y, theta=at.theta)


def _placed(seen: DetectedObject, place: LandmarkPlace | None) -> DetectedObject:
    """Return an object at the place of its landmark, if it is one."""
    if place is None:
        return seen
    sigma = worst_sigma(*place.covariance)
    return replace(seen, x=place.x, y=place.y, sigma=sigma, covariance=place.covariance)
