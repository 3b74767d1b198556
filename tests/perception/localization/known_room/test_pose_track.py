"""A track of hypotheses: quanta, the evidence for a place, and the pose between keyframes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.random_rooms import ACOUSTICS
from drivers.messages import Firing, Pose
from perception.localization.known_room import pose_track
from perception.localization.known_room.background import Background
from perception.localization.known_room.keyframes import KEYFRAMES_MAX, Keyframes
from perception.localization.known_room.mixed_reflection import LearnedShares
from perception.localization.known_room.particle_update import TEMPER
from perception.localization.known_room.pose_track import (
    ALIKE_GAIN,
    ALIKE_WEIGHT,
    EVIDENCE_MIN,
    MIRRORS,
    PLACE_EVIDENCE_MAX,
    QUANTA,
    PoseTrack,
    heading_noise,
)
from perception.localization.known_room.surroundings import make_surroundings
from perception.localization.room.range_likelihood import RangeModel
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
    around = make_surroundings(ROOM, MODEL, HALF_ANGLE)
    track = PoseTrack(around, Background(ROOM, around, 0.2), heading_noise(0))
    starts = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
    track.start(starts, 0.1, math.radians(3.0), keyframes.pose(0), 0, 0.0)
    return track


def test_a_keyframe_takes_quanta_for_each_hypothesis_and_the_right_one_is_left() -> None:
    keyframes = keyframes_of(1)
    track = track_at(Pose(TRUTH.x, TRUTH.y + 1.0, 2.0), TRUTH, keyframes=keyframes)
    done = []
    while track.is_behind(keyframes):
        done.append(track.enter(keyframes, LearnedShares()))
    assert done == [0] * (2 * QUANTA - 1) + [24]
    assert len(track) == 1
    assert track.explains > 0.9
    assert track.evidence == pytest.approx(PLACE_EVIDENCE_MAX)
    assert track.peak_at == 0
    pose = track.pose(Pose(0.1, 0.0, 0.12))  # odometry's frame is the ring's at the keyframe, but for the turn
    here = (
        Pose(track.best.x, track.best.y, track.best.heading).compose(Pose(0.0, 0.0, -0.12)).compose(Pose(0.1, 0, 0))
    )
    assert (pose.x, pose.y) == pytest.approx((here.x, here.y))
    assert (np.linalg.eigvalsh(track.covariance()) > 0.0).all()
    track.clear()
    assert len(track) == 0
    assert not track.is_behind(keyframes)


def test_where_nothing_is_a_mirror_a_place_must_explain_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """A right place explains rough surfaces wherever they are, and mirrors only where they answer."""
    monkeypatch.setattr(pose_track, "LIKENESS_MAX", 100.0)
    found = []
    for specular in (0.0, 0.5 * MIRRORS, MIRRORS):
        keyframes, shares = keyframes_of(1), LearnedShares()
        shares.records[0].specular = specular
        track = track_at(TRUTH, keyframes=keyframes)
        while track.is_behind(keyframes):
            track.enter(keyframes, shares)
        heard = float(np.isfinite(STAND.ranges_m).sum())
        gain = track.gained_since(0) / TEMPER
        found.append((gain - track.likeness / ALIKE_WEIGHT) / heard)
    low, high = ALIKE_GAIN
    assert found == pytest.approx([low, 0.5 * (low + high), high])


def test_what_speaks_against_a_place_adds_up_from_when_it_began() -> None:
    keyframes = keyframes_of(1)
    for k in range(1, 30):  # the true robot's readings would not stay while it drives
        keyframes.observe(Firing(1.0 + k, Pose(0.12 * k, 0.0, 0.0), 0.12, STAND.ranges_m))
    track, evidence = track_at(TRUTH, keyframes=keyframes), []
    while track.is_behind(keyframes):
        if track.enter(keyframes, LearnedShares()):
            evidence.append(track.evidence)
    assert max(evidence) == pytest.approx(PLACE_EVIDENCE_MAX)
    assert track.peak_at == max(k for k, value in enumerate(evidence) if value == max(evidence))
    assert evidence[-1] < 0.0
    assert track.explains < 0.1
    assert min(evidence) >= -EVIDENCE_MIN


def test_what_was_not_entered_in_time_is_passed_over() -> None:
    keyframes = keyframes_of(KEYFRAMES_MAX + 5)
    track = track_at(TRUTH, keyframes=keyframes)
    track.enter(keyframes, LearnedShares())
    assert track.entered == 5
