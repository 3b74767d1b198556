"""Perception as an anytime algorithm: a part that always runs, and refinement in quanta of bounded work.

`observe` takes one firing. `refine` does one quantum; the caller decides how many it can afford, and the rest
continues in the next cycle from where it stopped. A method recognises the objects: the paper's or the Bayesian one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from config.model import ModelConfig
from config.robot import PASSAGE_M, RingConfig
from config.settings import PerceptionConfig
from config.world import WorldConfig
from drivers.messages import Firing, Pose
from perception.area_edits import edit_areas, rejected
from perception.bounds import CONSTANT, bounds
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import (
    AreaEdit,
    ConfirmObject,
    Edit,
    Evidence,
    MoveObject,
    PlaceModel,
    PlaceRobot,
    RemoveObject,
    Segments,
    WithdrawConfirmation,
    invalid_edit,
)
from perception.kernel import Floats
from perception.localization.equal_edit import edit_equally
from perception.localization.localized_pose import LocalizedPose
from perception.localization.odometry_frame import OdometryFrame
from perception.mapping.canyons import ENDS_M, CanyonMap
from perception.mapping.no_surfaces import NoSurfaces
from perception.method import Method
from perception.no_method import NOT_READY, NoMethod
from perception.obstacle_echoes.fresh_echoes import FreshEchoes
from perception.obstacle_echoes.unheard_echoes import UnheardEchoes
from perception.obstacle_echoes.unheard_feet import with_unheard_feet
from perception.percept import Canyon, FieldOfView, OccupancyWindow
from perception.polyline import Polyline
from perception.recognition import NO_RECOGNITION, begin_recognition, find_in_room, place_robot, with_window
from perception.ring_faults.monitor import RingMonitor
from perception.sensor_faults.monitor import SensorMonitor
from perception.sensor_faults.report import SensorReport
from perception.sensor_mounts import farthest_m, mounts_array, reach_m
from perception.snapshot import Snapshot, put_back, snapshot_of
from perception.vacant_areas import VacantArea, VacantAreas

if TYPE_CHECKING:
    from perception.localization.known_room.known_room import KnownRoom
    from perception.localization.submaps.echo_lag import EchoLag
    from perception.mapping.grid.evidence_grid import EvidenceGrid
    from perception.recognition import PreparedRecognition


class Perception:
    """Echoes to objects and obstacles.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise.
    config : PerceptionConfig
        The method and its settings.
    recognises : bool
        Whether it recognises from the start. Until it does, the ring is heard and watched, and there is no map.
    """

    SCRATCH: Final = ("_farthest_m", "prepared")
    BOUNDS: Final = bounds(_axes=CONSTANT, _half_angle=CONSTANT, _reach_m=CONSTANT, _sensors=CONSTANT)

    def __init__(
        self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig, *, recognises: bool = True
    ) -> None:
        # Snapshots hold the attributes in this order.
        self.method: Method = NoMethod()
        self.sensor_monitor = SensorMonitor(ring)
        self.ring_monitor = RingMonitor(ring)
        self.map_frame = OdometryFrame()
        """Corrects drift, where the settings say so."""
        self._other: Method | None = None
        """A second method, which enters firings at corrected poses; its objects are the landmarks. Once odometry is
        refuted, it changes places with `method`, which stops."""
        self._ring = ring
        self.known_room: KnownRoom | None = None
        self.room: WorldConfig | None = None
        self.grid: EvidenceGrid | None = None  # in the odometry's frame, where the settings have one
        self.surfaces = NoSurfaces()  # in the frame of `method`
        self.echo_lag: EchoLag | None = None
        self.prepared: PreparedRecognition | None = None  # from another thread, for `recognise`
        mounts = mounts_array(ring.mounts)
        self._axes, self._turning = mounts[:, 2].copy(), list(ring.turning)
        self._half_angle, self._models = math.radians(ring.beam_half_angle_deg), tuple(models)
        self._echoes = FreshEchoes(mounts, self._half_angle, ring.turning, ring.window_m, ring.sensor_of)
        self._reach_m, self._sensors, self._farthest_m = reach_m(ring), len(ring.mounts), farthest_m(ring.mounts)
        self.vacant = VacantAreas()  # in the frame of `method`
        self.canyon_map = CanyonMap(2.0 * (self._farthest_m + PASSAGE_M) - ENDS_M)
        """The box canyons found so far, in odometry's frame."""
        if recognises:
            self.recognise(models, config)

    @property
    def recognises(self) -> bool:
        """Whether echoes are entered into a map."""
        return not isinstance(self.method, NoMethod)

    def recognise(self, models: Sequence[ModelConfig], config: PerceptionConfig, *, on: bool = True) -> None:
        """Begin to recognise these models, with an empty map, as at a start; or stop, and have no map."""
        self._models, (ready, self.prepared) = tuple(models), (self.prepared, None)
        parts = begin_recognition(self._ring, self._models, config, ready) if on else NO_RECOGNITION
        self.method, self._other, self.map_frame, self.known_room, self.grid, self.surfaces, self.echo_lag = parts
        self.room = config.localization.known_room if on else None

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        return self.method.can_refine or self.canyon_map.is_due or any(one.can_refine for one in self._refined()[1:])

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return not self.can_refine and self.surfaces.converged and all(one.converged for one in self._fed())

    @property
    def counts(self) -> MapCounts:
        """The numbers of segments and hypotheses."""
        return self.method.counts

    def observe(self, firing: Firing) -> int:
        """Enter one firing and return how many outline segments it completed.

        Raises
        ------
        ValueError
            The firing is of another ring; compiled code would read beyond its arrays.
        """
        if len(firing.ranges_m) != self._sensors:
            raise ValueError(f"a firing of {len(firing.ranges_m)} ranges, but the ring has {self._sensors} sensors")
        trusted, possible = self.sensor_monitor.filter(firing)
        self.sensor_monitor.mask_stuck(self.ring_monitor.observe(possible))
        self._echoes.update(possible)
        if self.echo_lag is not None:
            trusted = self.echo_lag.follow(trusted)
        if self.known_room is not None:
            self.known_room.observe(trusted)
        placed = self._correct(trusted)
        made = self.method.observe(placed)
        self.surfaces.observe(placed)
        if self.grid is not None:
            self.grid.observe(trusted, slanting=self.method.locate_echoes(self.grid.bearings))
        self.canyon_map.observe(trusted.pose)
        return made

    def _correct(self, firing: Firing) -> Firing:
        """Return a firing at the pose at which `method` enters it: by odometry, until that is refuted."""
        if self._other is None:
            return firing
        self.map_frame.move((self.method, self.surfaces, self.vacant))
        fed = self._fed()
        placed = self.map_frame.follow(firing, self.vacant.outside(fed[-1].near_objects()), fed[-1].shift_object)
        if len(fed) > 1 and self.map_frame.is_applied:
            self.method, self._other = self._other, self.method
            self.surfaces.clear()  # it was in odometry's frame
        elif len(fed) > 1:
            self._other.observe(placed)
        return placed if self.map_frame.is_settled else firing

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero if nothing is left to improve.

        The method comes first: its quanta of a firing are few, while the search of a known room has hundreds.
        """
        if self.method.can_refine:
            return self.method.refine()
        if self.canyon_map.is_due:
            radii_m = {one.name: one.arc_radius_m for one in self._models if one.arc_radius_m is not None}
            self.canyon_map.refine(self._in_odometry(self.vacant.outside(self.method.labelled_objects())), radii_m)
            return 1
        return next((one.refine() for one in self._refined()[1:] if one.can_refine), 0)

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised so far: those near the robot, best first, then those left behind."""
        return self._in_odometry(self.vacant.outside(self.surfaces.report(self._known).shown(self.method.objects())))

    def mapped_objects(self) -> tuple[DetectedObject, ...]:
        """Return the same objects in the map frame; without correction of drift that is odometry's."""
        return self.map_frame.in_map(self.vacant.outside(self.method.objects()))

    def localized(self) -> LocalizedPose | None:
        """Return where the robot was at the last firing in the map frame; None where that is odometry's."""
        return (self.known_room or self.map_frame).localized()

    def known_map_frame(self) -> Pose | None:
        """Return the pose of the map frame in odometry's frame, None while the place is not known."""
        here = self.localized()
        return self.odometry_from_map() if here is not None and here.status == "tracking" else None

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame, at the last firing."""
        return (self.known_room or self.map_frame).odometry_from_map()

    def near_objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised near the robot, best first; the cost does not depend on the map's size."""
        return self._in_odometry(self.vacant.outside(self.method.near_objects()))

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return what has a label: models, walls, corners, posts, unknowns near the robot, and pieces of walls."""
        report = self.surfaces.report(self._known)
        return self._in_odometry(self.vacant.outside((*report.shown(self.method.labelled_objects()), *report.walls)))

    def archived_objects(self) -> tuple[DetectedObject, ...]:
        """Return what has a label and was left behind; without correction the same tuple until it changes."""
        archived = self.surfaces.archived_shown(self.method.archived_objects(), self._known)
        return self._in_odometry(self.vacant.archived_outside(archived))

    def polylines(self) -> tuple[Polyline, ...]:
        """Return what is not straight; without correction the same tuple until it changes."""
        seen = self.vacant.polylines_outside(self.surfaces.report(self._known).polylines)
        return self.map_frame.polylines_in_odometry(seen)

    def vacant_areas(self) -> tuple[VacantArea, ...]:
        """Return the areas in which nothing stands, in odometry's frame."""
        return self.map_frame.areas_in_odometry(self.vacant.listed())

    def _in_odometry(self, seen: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return what the method holds in odometry's frame."""
        return self.map_frame.objects_in_odometry(seen)

    def segment_geometry(self) -> Floats:
        """Return a copy of the outline segments: end points x1, y1, x2, y2 (m) and normal (rad), shape (n, 5)."""
        return self.map_frame.segments_in_odometry(self.method.segment_geometry())

    def segments(self) -> Segments:
        """Return copies of the outline segments with their numbers, times and pins."""
        held = self.method.segments()
        return held._replace(geometry=self.map_frame.segments_in_odometry(held.geometry))

    def edit(self, edit: Edit) -> str | None:
        """Apply an operator's edit; return None, or why it cannot be applied, as text for the operator.

        No edit changes the obstacles that the robot avoids: the fresh echoes stay.
        """
        if not self.recognises:
            return NOT_READY
        if isinstance(edit, PlaceRobot):
            return place_robot(self.known_room, edit)
        if isinstance(edit, AreaEdit):
            return edit_areas(self.vacant, self.map_frame.edit_in_filter(edit), self._known, self._models)
        refused = invalid_edit(edit)
        if refused is None and isinstance(edit, ConfirmObject | WithdrawConfirmation | RemoveObject):
            refused = rejected(self.vacant, edit.object, self._known())
        if refused is not None:
            return refused
        inside = self.map_frame.edit_in_filter(edit)
        for other in self._fed()[1:]:
            edit_equally(inside, self.method, other)
        refused = self.method.edit(inside)
        if refused is None and isinstance(inside, PlaceModel | MoveObject):
            self.vacant.lift_at(inside.x, inside.y)
        return refused

    def _known(self) -> tuple[DetectedObject, ...]:
        """Return all objects in the method's frame, those that a vacant area hides included."""
        return (*self.method.labelled_objects(), *self.method.archived_objects())

    def known_objects(self) -> tuple[DetectedObject, ...]:
        """Return all objects in odometry's frame, those that a vacant area hides included."""
        return self._in_odometry(self._known())

    def evidence(self, number: int) -> Evidence | None:
        """Return the evidence for an object, None if no object has this number; changes nothing."""
        return self.map_frame.evidence_in_odometry(self.method.evidence(number))

    def obstacles(self, robot_s: float, age_max_s: float) -> Floats:
        """Return each sensor's last echo if no older than `age_max_s` at the robot's time: shape (k, 2), m."""
        return self._echoes.points(robot_s, age_max_s)

    def steady_obstacles(self, robot_s: float, age_max_s: float, pose: Pose) -> Floats:
        """Return those of the obstacles with which another look, or what is recognised, agrees: shape (k, 2), m."""
        return self._with_feet(self._echoes.steady_points(robot_s, age_max_s), pose)

    def _with_feet(self, points: Floats, pose: Pose) -> Floats:
        """Return places of echoes, and the feet of near objects that none of them stands for."""
        return with_unheard_feet(points, self.near_objects(), self._models, pose, self._farthest_m)

    @property
    def unheard(self) -> UnheardEchoes:
        """The echoes that fell silent as the robot came nearer, and those that are remembered."""
        return self._echoes.unheard

    def surroundings(
        self, robot_s: float, ring_yaw: float, pose: Pose, age_max_s: float
    ) -> tuple[FieldOfView, Floats]:
        """Return where the ring has looked, and the obstacles: echoes, what is recognised, walls beside blind sides.

        Parameters
        ----------
        robot_s : float
            The robot's time now, s.
        ring_yaw : float
            Direction of the ring now, rad.
        pose : Pose
            The robot's now; its direction is that of the sensors that turn with the wheels.
        age_max_s : float
            Longest age at which a direction counts as seen, s.
        """
        bearings, ages, since, echoes = self._echoes.looks(robot_s, age_max_s)
        axes = ring_yaw + self._axes
        if self._turning:
            axes[self._turning] += pose.theta - ring_yaw
        points, *sides = self._echoes.with_blind_sides(self._with_feet(echoes, pose), pose, axes)
        return FieldOfView(bearings, ages, axes, since, self._half_angle, self._reach_m, age_max_s, *sides), points

    def canyons(self) -> tuple[Canyon, ...]:
        """Return the box canyons found so far, in odometry's frame, those left behind included."""
        return self.canyon_map.canyons()

    def occupancy(self) -> OccupancyWindow | None:
        """Return the evidence grid around the robot, None where the settings have none."""
        return None if self.grid is None else self.grid.occupancy()

    def reset(self) -> None:
        """Start again with an empty map, as after a reset of the odometry."""
        monitors = (self.sensor_monitor, self.ring_monitor)
        for part in (*self._methods(), self.map_frame, self.known_room, self.echo_lag, *monitors):
            if part is not None:
                part.reset()
        for memory in (self.grid, self.surfaces, self.vacant, self.canyon_map, self._echoes):
            if memory is not None:
                memory.clear()

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Use other settings, of those that a running process may change (`config.reload.LIVE_SETTINGS`)."""
        for method in self._methods():
            method.apply_settings(config)
        self.surfaces.apply_settings(config.surfaces)
        room = config.localization.known_room
        if self.recognises and room != self.room:
            self.room, self.known_room = room, find_in_room(room, self._ring)

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Recognise these models: the present ones, and possibly further ones after them."""
        if tuple(models) != self._models:
            self._models = tuple(models)
            for method in self._methods():
                method.set_models(models)
            self.map_frame.set_models(models)
            self.surfaces.set_models(models)

    def _methods(self) -> tuple[Method, ...]:
        return (self.method,) if self._other is None else (self.method, self._other)

    def _fed(self) -> tuple[Method, ...]:
        """Return the methods that enter firings."""
        return (self.method,) if self.map_frame.is_settled else self._methods()

    def _refined(self) -> tuple[Method | NoSurfaces | OdometryFrame | KnownRoom | EchoLag, ...]:
        """Return what takes quanta, in that order; `canyon_map` follows the first."""
        parts = (self.method, self.known_room or self.map_frame, *self._fed()[1:], self.surfaces)
        return parts if self.echo_lag is None else (*parts, self.echo_lag)

    def set_firing_pattern(self, ring: RingConfig) -> None:
        """Expect another firing pattern of the same sensors, and echoes from as far as it listens."""
        before, self._ring = self._ring.window_m, ring
        self.sensor_monitor.set_firing_pattern(ring)
        if ring.window_m != before:
            self.ring_monitor.set_reach(ring.window_m)
            self._echoes.set_reach(ring.window_m)
            self._reach_m, self.known_room = reach_m(ring), with_window(self.known_room, self.room, ring)

    def sensor_reports(self) -> tuple[SensorReport, ...]:
        """Return a report on each faulty sensor."""
        return self.sensor_monitor.reports()

    def snapshot(self) -> Snapshot:
        """Return copies of the whole state, from which `restore` continues with identical results."""
        return snapshot_of(self)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot that perception with the same settings made.

        Raises
        ------
        ValueError
            The snapshot was made with other settings.
        """
        put_back(self, snapshot)
        places = (self.map_frame, self.known_room, self.echo_lag)
        for part in (*self._methods(), self.vacant, self.grid, self.surfaces, *places):
            if part is not None:
                part.drop_caches()
