"""The map frame: recognised drums become landmarks, objects move with them, and results come in odometry's frame."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.load import load_settings
from config.settings import LocalizationConfig
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.edits import Arc, ClearMap, Evidence, Line, PlaceModel
from perception.localization.map_frame import MapFrame
from perception.map_moves import MapMoves
from perception.pipeline import Perception
from perception.polyline import Polyline
from runtime.simulation.drift_trials import LEVELS, drum_hall, firings, oval

SETTINGS = load_settings("hallway")
CORRECTED = SETTINGS.perception.model_copy(update={"localization": LocalizationConfig(correct_drift=True)})
SEED = 300
FIRINGS = 700


def map_frame(perception: Perception) -> MapFrame:
    """Return the map frame of a perception that corrects drift."""
    assert isinstance(perception.map_frame, MapFrame)
    return perception.map_frame


def drive(errors: int, count: int) -> tuple[Perception, list[Firing]]:
    """Drive the first part of the oval with odometry of this level of errors."""
    perception = Perception(SETTINGS.ring, SETTINGS.models, CORRECTED)
    entered = list(firings(SETTINGS, drum_hall(SEED), oval(2)[:count], LEVELS[errors], SEED, synchro=False))
    for firing in entered:
        enter(perception, firing)
    return perception, entered


def enter(perception: Perception, firing: Firing) -> None:
    """Enter a firing and refine."""
    perception.observe(firing)
    while perception.can_refine and perception.refine():
        pass


def landmarks_of(perception: Perception) -> tuple[DetectedObject, ...]:
    """Return the objects of the method that enters firings at corrected poses, before odometry is refuted."""
    assert perception._other is not None
    return perception._other.objects()


def turned_frame() -> MapFrame:
    """Return a map frame at (1, 2) in odometry's frame, turned by a quarter."""
    frame = MapFrame(SETTINGS.ring, SETTINGS.models)
    silent = np.full(len(SETTINGS.ring.mounts), np.nan)
    frame.follow(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, silent), (), lambda *_: None)
    frame.drift._enter_next()
    frame.drift._evidence.is_refuted = True
    e = frame.drift.e[0]
    e.x, e.y, e.heading = -2.0, 1.0, -0.5 * math.pi
    return frame


@pytest.mark.compiled
def test_recognised_drums_become_landmarks_and_have_their_places() -> None:
    perception, entered = drive(2, FIRINGS)
    frame, here = map_frame(perception), perception.localized()
    assert here is not None
    assert here.status == "tracking"
    places = [(seen, frame.drift.places().get(seen.number or 0)) for seen in perception.mapped_objects()]
    landmarks = [(seen, place) for seen, place in places if place is not None]
    assert len(landmarks) >= 3
    to = frame.drift.map_from_filter()
    for seen, place in landmarks:
        mapped_place = to.compose(Pose(place.x, place.y, 0.0))
        assert (seen.x, seen.y) == (mapped_place.x, mapped_place.y)
    true = oval(2)[FIRINGS - 1]
    assert (here.pose.x, here.pose.y) == pytest.approx((true.x, true.y), abs=0.1)
    assert (here.pose.x, here.pose.y) != (entered[-1].pose.x, entered[-1].pose.y)
    assert {type(v) for seen in perception.objects() for v in (seen.x, seen.y, seen.theta, seen.sigma)} == {float}
    assert {type(v) for v in (here.pose.x, here.pose.theta, here.ring_yaw, here.probability)} == {float}
    for mapped, seen in zip(perception.mapped_objects(), perception.objects(), strict=True):
        from_map = Pose(here.pose.x, here.pose.y, here.ring_yaw).inverse().compose(Pose(mapped.x, mapped.y, 0.0))
        at = entered[-1]
        from_odometry = Pose(at.pose.x, at.pose.y, at.ring_yaw).inverse().compose(Pose(seen.x, seen.y, 0.0))
        assert (from_map.x, from_map.y) == pytest.approx((from_odometry.x, from_odometry.y))


@pytest.mark.compiled
def test_a_drive_continues_from_a_snapshot_to_the_bit() -> None:
    first, entered = drive(3, 130)
    snapshot = first.snapshot()
    second = Perception(SETTINGS.ring, SETTINGS.models, CORRECTED)
    second.restore(snapshot)
    for firing in entered[:5]:
        for perception in (first, second):
            enter(perception, replace(firing, robot_s=firing.robot_s + 60.0))
    assert first.objects() == second.objects()
    assert first.mapped_objects() == second.mapped_objects()
    assert repr(first.localized()) == repr(second.localized())


@pytest.mark.compiled
def test_objects_move_with_their_landmarks() -> None:
    perception, entered = drive(0, 120)
    seen, landmarks = landmarks_of(perception)[0], map_frame(perception).drift.e[0]
    (i,) = (k for k in range(landmarks.count) if landmarks.landmarks[k].number == seen.number)
    landmarks.landmarks[i].x += 0.05
    perception.observe(entered[-1])
    (after,) = (one for one in landmarks_of(perception) if one.number == seen.number)
    assert after.x == pytest.approx(seen.x + 0.05, abs=0.01)


def test_once_maps_of_the_way_correct_the_pose_no_landmark_takes_over() -> None:
    frame, silent = MapFrame(SETTINGS.ring, SETTINGS.models), np.full(len(SETTINGS.ring.mounts), np.nan)
    frame.submaps.is_applied = True
    drum = DetectedObject("drum", 1.0, 0.0, 0.0, 0.02, 90, 1.0, number=3, covariance=(1e-4, 0.0, 1e-4))
    firing = Firing(0.0, Pose(1.0, 2.0, 0.5), 0.5, silent)
    assert frame.follow(firing, (drum,), lambda *_: None) is firing
    assert frame.drift.places() == {}
    assert frame.corrects_path
    assert not frame.is_applied
    assert frame.localized().pose == Pose(1.0, 2.0, 0.5)


def test_maps_of_the_way_move_the_frame_in_which_firings_are_entered() -> None:
    frame, silent = MapFrame(SETTINGS.ring, SETTINGS.models), np.full(len(SETTINGS.ring.mounts), np.nan)
    noted: list[tuple[int, bool]] = []

    class Memory:
        """What is remembered notes what it is asked to follow."""

        def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
            noted.append((submap, moves is not None))

    firing = Firing(0.0, Pose(1.0, 2.0, 0.5), 0.3, silent)
    frame.move((Memory(),))
    frame.follow(firing, (), lambda *_: None)
    held = frame.submaps.held
    frame.submaps.is_applied = held.is_moved = True
    held._from_map[:] = 2.0, 0.0, 0.5 * math.pi
    placed = frame.follow(firing, (), lambda *_: None)
    assert (placed.pose.x, placed.pose.y) == pytest.approx((0.0, 1.0))
    assert (placed.pose.theta, placed.ring_yaw) == pytest.approx((0.5 + 0.5 * math.pi, 0.3 + 0.5 * math.pi))
    drum = DetectedObject("drum", 0.0, 2.0, 0.0, 0.02, 90, 1.0, number=3, covariance=(1e-4, 0.0, 4e-4))
    (seen,), (mapped,) = frame.objects_in_odometry((drum,)), frame.in_map((drum,))
    assert (seen.x, seen.y) == pytest.approx((2.0, 2.0)), "beside the robot, as it was heard"
    assert (mapped.x, mapped.y) == pytest.approx((2.0, 2.0)), "the map frame is odometry's so far"
    assert seen.covariance == pytest.approx((4e-4, 0.0, 1e-4))
    edit = frame.edit_in_filter(PlaceModel("drum", 2.0, 2.0, 0.0))
    assert (edit.x, edit.y) == pytest.approx((0.0, 2.0))
    assert noted == [(0, False)]


def test_the_way_is_known_once_maps_of_it_correct_odometry() -> None:
    frame = MapFrame(SETTINGS.ring, SETTINGS.models)
    assert frame.known_way() is None
    frame.submaps.is_applied = True
    assert frame.known_way() is frame.submaps.known_way()


def test_without_recognition_the_pose_is_odometrys() -> None:
    perception, entered = drive(1, 3)
    assert perception.objects() == perception.mapped_objects() == ()
    here = perception.localized()
    assert here is not None
    assert here.pose == entered[-1].pose
    perception.reset()
    assert map_frame(perception).drift.localized().pose == Pose(0.0, 0.0, 0.0)


def test_without_correction_the_map_frame_is_that_of_odometry() -> None:
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    assert not perception.map_frame.is_applied
    assert perception.localized() is None
    assert perception.mapped_objects() == ()
    polylines = (Polyline(1, np.ones((2, 2)), 0.9),)
    assert perception.map_frame.polylines_in_odometry(polylines) is polylines


def test_results_are_turned_into_odometrys_frame_and_edits_into_the_maps() -> None:
    frame = turned_frame()
    to = frame.drift.odometry_from_map()
    assert (to.x, to.y, to.theta) == pytest.approx((1.0, 2.0, 0.5 * math.pi))
    seen = DetectedObject("drum", 1.0, 0.0, 0.1, 0.2, 9, 0.9, covariance=(0.04, 0.0, 0.01))
    (turned,) = frame.objects_in_odometry([seen])
    assert (turned.x, turned.y, turned.theta) == pytest.approx((1.0, 3.0, 0.1 + 0.5 * math.pi))
    assert turned.covariance == pytest.approx((0.01, 0.0, 0.04))
    assert frame.objects_in_odometry([replace(seen, covariance=None)])[0].covariance is None
    assert frame.segments_in_odometry(np.array([[1.0, 0.0, 0.0, 1.0, 0.2]]))[0] == pytest.approx(
        [1.0, 3.0, 0.0, 2.0, 0.2 + 0.5 * math.pi]
    )
    (polyline,) = frame.polylines_in_odometry((Polyline(1, np.array([[1.0, 0.0], [0.0, 1.0]]), 0.9),))
    assert polyline.points == pytest.approx(np.array([[1.0, 3.0], [0.0, 2.0]]))
    edit = frame.edit_in_filter(PlaceModel("drum", 1.0, 3.0, 0.0))
    assert (edit.x, edit.y, edit.theta) == pytest.approx((1.0, 0.0, -0.5 * math.pi))
    assert frame.edit_in_filter(ClearMap()) == ClearMap()
    evidence = Evidence(1, "drum", (Arc(1.0, 0.0, 0.0, None, 1.0),), (Line(1, 1.0, 0.0, 0.0, 1.0, supports=True),))
    found = frame.evidence_in_odometry(evidence)
    assert found is not None
    assert (found.arcs[0].x, found.arcs[0].y, found.arcs[0].direction) == pytest.approx((1.0, 3.0, 0.5 * math.pi))
    assert (found.lines[0].x2, found.lines[0].y2) == pytest.approx((0.0, 2.0))
    assert frame.evidence_in_odometry(None) is None
