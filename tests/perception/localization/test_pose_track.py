"""A track of hypotheses: quanta, the recent fit, and the pose between keyframes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.localization.keyframes import KEYFRAMES_MAX, Keyframes
from perception.localization.pose_track import RECENT_MAX, PoseTrack, heading_noise
from perception.localization.range_likelihood import RangeModel
from perception.localization.surroundings import make_surroundings
from runtime.simulation.random_rooms import ACOUSTICS
from tests.perception.localization.rooms import CROOKED, HALF_ANGLE, RING, stand, world_of

pytestmark = pytest.mark.compiled
TRUTH = Pose(1.5, 2.2, 0.5)
MODEL = RangeModel.of_ring(RING)
ROOM, STAND = stand(world_of(CROOKED, ACOUSTICS), TRUTH)


def keyframes_of(count: int, turn: float = 0.12) -> Keyframes:
    """The same readings again and again, of a robot that turns on the spot by this angle, and hears otherwise."""
    keyframes = Keyframes(np.array(RING.mounts))
    for k in range(count + 1):
        keyframes.observe(Firing(0.1 * k, Pose(0.0, 0.0, 0.0), turn * k, STAND.ranges_m))
    assert keyframes.count == count
    return keyframes


def track_at(*poses: Pose, keyframes: Keyframes) -> PoseTrack:
    """A track with hypotheses at these poses."""
    track = PoseTrack(make_surroundings(ROOM, MODEL, HALF_ANGLE), MODEL, heading_noise(0))
    starts = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
    track.start(starts, 0.1, math.radians(3.0), keyframes.pose(0), 0)
    return track


def test_a_keyframe_takes_quanta_for_each_hypothesis_and_the_right_one_is_left() -> None:
    keyframes = keyframes_of(1)
    track = track_at(Pose(TRUTH.x, TRUTH.y + 1.0, 2.0), TRUTH, keyframes=keyframes)
    done = []
    while track.is_behind(keyframes):
        done.append(track.enter(keyframes, 0.5))
    assert done == [0, 0, 0, 24]
    assert len(track) == 1
    assert track.readings == 24
    assert track.way_m == 0.0
    assert track.explains(1.0, 0.35) > track.explains(1.0, 3.0)
    assert track.explains(1.0, 0.35) > 0.9
    pose = track.pose(Pose(0.1, 0.0, 0.12))  # odometry's frame is the ring's at the keyframe, but for the turn
    here = (
        Pose(track.best.x, track.best.y, track.best.heading).compose(Pose(0.0, 0.0, -0.12)).compose(Pose(0.1, 0, 0))
    )
    assert (pose.x, pose.y) == pytest.approx((here.x, here.y))
    assert (np.linalg.eigvalsh(track.covariance()) > 0.0).all()
    track.clear()
    assert len(track) == 0
    assert not track.is_behind(keyframes)


def test_a_place_that_does_not_explain_the_readings_says_so_and_memory_is_bounded() -> None:
    keyframes = keyframes_of(RECENT_MAX + 10)
    track = track_at(TRUTH, keyframes=keyframes)  # the true robot would not turn while its readings stay
    while track.is_behind(keyframes):
        track.enter(keyframes, 0.5)
    assert track.explains(1.0, 0.35) < 0.1
    assert track.readings == 24 * RECENT_MAX


def test_what_was_not_entered_in_time_is_passed_over() -> None:
    keyframes = keyframes_of(KEYFRAMES_MAX + 5)
    track = track_at(TRUTH, keyframes=keyframes)
    track.enter(keyframes, 0.5)
    assert track.entered == 5
