"""Perception in the map frame: recognised drums become landmarks, and objects move with them."""

from __future__ import annotations

import pytest

from config.load import load_settings
from drivers.messages import Firing
from perception.localization.drift_correction import SeenObject
from perception.localization.localized_perception import LocalizedPerception
from runtime.simulation.drift_trials import LEVELS, drum_hall, firings, oval

SETTINGS = load_settings("hallway")
SEED = 300
FIRINGS = 220


def drive(errors: int, count: int) -> tuple[LocalizedPerception, list[Firing]]:
    """Drive the first part of the oval with odometry of this level of errors."""
    perception = LocalizedPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    entered = []
    for firing in firings(SETTINGS, drum_hall(SEED), oval(1)[:count], LEVELS[errors], SEED, synchro=False):
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        entered.append(firing)
    return perception, entered


@pytest.mark.compiled
def test_recognised_drums_become_landmarks_and_have_their_places() -> None:
    perception, entered = drive(2, FIRINGS)
    objects = [seen for seen in perception.objects() if seen.number is not None]
    assert len(objects) >= 3
    for seen in objects:
        place = perception.drift.place(seen.number or 0)
        if place is not None:
            assert (seen.x, seen.y, seen.covariance) == (place.x, place.y, place.covariance)
    assert sum(perception.drift.place(seen.number or 0) is not None for seen in objects) >= 3
    here = perception.localized()
    true = oval(1)[FIRINGS - 1]
    assert here.status == "tracking"
    assert (here.pose.x, here.pose.y) == pytest.approx((true.x, true.y), abs=0.1)
    assert (entered[-1].pose.x, entered[-1].pose.y) != (here.pose.x, here.pose.y)


@pytest.mark.compiled
def test_a_drives_result_depends_on_its_firings_alone() -> None:
    first, second = (drive(3, 120)[0] for _ in range(2))
    assert first.objects() == second.objects()
    assert first.localized().pose == second.localized().pose


@pytest.mark.compiled
def test_objects_move_with_their_landmarks() -> None:
    perception, entered = drive(0, 120)
    seen = perception.perception.objects()[0]
    landmarks = perception.drift.e[0]
    (i,) = (k for k in range(landmarks.count) if landmarks.landmarks[k].number == seen.number)
    landmarks.landmarks[i].x += 0.05
    perception.observe(entered[-1])
    (after,) = (one for one in perception.perception.objects() if one.number == seen.number)
    assert after.x == pytest.approx(seen.x + 0.05, abs=0.01)


def test_without_recognition_the_pose_is_odometrys() -> None:
    perception, entered = drive(1, 3)
    assert perception.objects() == ()
    assert perception.localized().pose == entered[-1].pose
    perception.drift.learn([SeenObject(1, 1.0, 0.0, 0.3)])
    assert perception.drift.place(1) is None
