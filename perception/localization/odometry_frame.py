"""The map frame of a run without correction of drift: odometry's own, in which everything is as it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from config.model import ModelConfig
from drivers.messages import IDENTITY, Firing, Pose
from perception.detected_object import DetectedObject
from perception.edits import AreaEdit, Evidence, MapEdit
from perception.kernel import Floats
from perception.localization.localized_pose import KnownWay, LocalizedPose, Moment
from perception.map_moves import FollowsMaps
from perception.polyline import Polyline
from perception.vacant_areas import VacantArea

AnyEdit = TypeVar("AnyEdit", bound=MapEdit | AreaEdit)


class OdometryFrame:
    """The identity; `perception.localization.map_frame.MapFrame` corrects drift instead."""

    @property
    def is_applied(self) -> bool:
        """Whether poses are corrected."""
        return False

    @property
    def is_settled(self) -> bool:
        """Whether it is known in which frame firings are entered from now on."""
        return self.is_applied or self.corrects_path

    @property
    def corrects_path(self) -> bool:
        """Whether earlier poses are corrected later, too."""
        return False

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Make landmarks of the round ones of these models."""

    def reset(self) -> None:
        """Start again: the next firing's odometry defines the map frame."""

    @property
    def can_refine(self) -> bool:
        """Whether a pose waits for quanta."""
        return False

    def refine(self) -> int:
        """Do one quantum, and return 1, or 0 where there is nothing to improve."""
        return 0

    def drop_caches(self) -> None:
        """Forget what follows from the rest, after a snapshot was put back."""

    def follow(
        self, firing: Firing, _objects: Sequence[DetectedObject], _shift: Callable[[int, float, float], object]
    ) -> Firing:
        """Return a firing at its pose in the frame in which the method enters it."""
        return firing

    def move(self, memories: Iterable[FollowsMaps]) -> None:
        """Move what is remembered with the maps of the way."""

    def localized(self) -> LocalizedPose | None:
        """Return where the robot was at the last firing; None where the map frame is odometry's."""
        return None

    def moment(self) -> Moment | None:
        """Return the moment of the last firing, for `as_known_now`; None where its pose will not change."""
        return None

    def as_known_now(self, then: LocalizedPose, _moment: Moment | None) -> LocalizedPose:
        """Return where the robot was at a moment, as known now, instead of as it was known then."""
        return then

    def moved_since(self, _moment: Moment) -> Pose:
        """Return the pose of odometry's frame of a moment in that of now, as known now."""
        return IDENTITY

    def known_way(self) -> KnownWay | None:
        """Return the way as known now, in the map frame; None where no map of it corrects odometry."""
        return None

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame."""
        return IDENTITY

    def in_map(self, objects: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return objects of the method's frame in the map frame."""
        return objects

    def objects_in_odometry(self, objects: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return objects of the method's frame in odometry's frame."""
        return objects

    def polylines_in_odometry(self, polylines: tuple[Polyline, ...]) -> tuple[Polyline, ...]:
        """Return polylines of the method's frame in odometry's frame."""
        return polylines

    def segments_in_odometry(self, geometry: Floats) -> Floats:
        """Return segments in odometry's frame: ends x1, y1, x2, y2 (m) and normal (rad), shape (n, 5)."""
        return geometry

    def areas_in_odometry(self, areas: tuple[VacantArea, ...]) -> tuple[VacantArea, ...]:
        """Return vacant areas of the method's frame in odometry's frame."""
        return areas

    def evidence_in_odometry(self, evidence: Evidence | None) -> Evidence | None:
        """Return the evidence for an object of the method's frame in odometry's frame."""
        return evidence

    def edit_in_filter(self, edit: AnyEdit) -> AnyEdit:
        """Return an operator's edit, whose places are in odometry's frame, in the method's frame."""
        return edit
