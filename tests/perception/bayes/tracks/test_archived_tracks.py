"""Tracks as archived records, and back."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import Pose
from perception.bayes.circles.outline_check import OUTLINE_READINGS_MIN
from perception.bayes.inference import reservoir
from perception.bayes.memory.elements import BEARING_BINS, BIN_CAPACITY, Reading
from perception.bayes.memory.state import CircleTrack, Memory, PolygonTrack
from perception.bayes.tracks.archived_tracks import (
    ARCHIVED_READINGS,
    archived_dtype,
    bearing_bins,
    move_rows,
    newest_readings,
    pack,
    unpack,
)
from perception.map_moves import MapMoves
from perception.records import records, zeros
from tests.perception.bayes.random_tracks import new_memory, random_track

BYTES_MAX = 2000


def filled(seed: int, readings: int) -> Memory:
    """Return a memory whose first circle holds so many random readings."""
    memory, rng = new_memory(), np.random.default_rng(seed)
    random_track(rng, memory, 0)
    track = memory.tracks[0]
    memory.circles["bins"]["count"][0] = 0
    one = zeros(Reading, 1)
    for _ in range(readings):
        turn = rng.uniform(-np.pi, np.pi)
        one[0] = (
            *(np.array([track.x, track.y]) + rng.uniform(-6.0, 6.0, 2)),
            np.cos(turn),
            np.sin(turn),
            3.0,
            0.0,
            0.0,
        )
        reservoir.keep_reading(track, track.x, track.y, records(Reading, one)[0])
    return memory


@pytest.mark.parametrize("readings", [0, 3, ARCHIVED_READINGS, 400])
def test_a_track_comes_back_as_it_was_but_for_its_older_readings(readings: int) -> None:
    memory = filled(readings, readings)
    before = memory.circles[0].copy()
    row = pack(memory.circles[:1], archived_dtype(CircleTrack), is_reported=True)
    unpack(row, memory.circles[1:2])
    after = memory.circles[1]
    for name in CircleTrack.DTYPE.names or ():
        if name != "bins":
            assert np.array_equal(after[name], before[name]), name
    kept = np.minimum(before["bins"]["count"], BIN_CAPACITY)
    counts = after["bins"]["count"]
    assert counts.sum() == min(kept.sum(), ARCHIVED_READINGS)
    assert (counts <= kept).all()
    assert (counts == kept).all() or kept.sum() > ARCHIVED_READINGS
    for b, count in enumerate(counts.tolist()):
        newest = [int(before["bins"]["count"][b] - 1 - k) % BIN_CAPACITY for k in range(count)][::-1]
        for field in ("x", "y", "axis_x", "axis_y", "range_m"):
            held = after["bins"]["readings"][b, :count][field]
            assert held == pytest.approx(before["bins"]["readings"][b, newest][field], abs=2e-6)


def test_a_bearing_that_gets_more_than_it_holds_keeps_the_newest() -> None:
    memory = filled(2, 400)
    memory.circles["x"][0] -= 500.0  # the fit moved since the readings were kept: all lie at one bearing now
    memory.circles["y"][0] -= 100.0
    newest = newest_readings(memory.circles["bins"][0])[:BIN_CAPACITY][::-1]
    unpack(pack(memory.circles[:1], archived_dtype(CircleTrack), is_reported=True), memory.circles[1:2])
    bins = memory.circles["bins"][1]
    (b,) = np.flatnonzero(bins["count"]).tolist()
    assert bins["count"][b] == BIN_CAPACITY < ARCHIVED_READINGS
    assert bins["readings"]["x"][b] == pytest.approx(newest["x"], abs=1e-4)
    assert bins["readings"]["y"][b] == pytest.approx(newest["y"], abs=1e-4)


def test_of_many_readings_bearings_all_round_keep_as_many_as_the_outline_needs() -> None:
    bins = filled(1, 400).circles["bins"][0]
    kept = newest_readings(bins)
    assert len(kept) == ARCHIVED_READINGS
    held = {one.tobytes() for one in kept}
    full = []
    for b in np.flatnonzero(bins["count"] >= OUTLINE_READINGS_MIN).tolist():
        newest = [(bins["count"][b] - 1 - k) % BIN_CAPACITY for k in range(OUTLINE_READINGS_MIN)]
        if all(bins["readings"][b, k].tobytes() in held for k in newest):
            full.append(b)
    assert len(full) == ARCHIVED_READINGS // OUTLINE_READINGS_MIN
    assert max(np.diff([*full, full[0] + BEARING_BINS])) <= 4, "they lie all round"


@pytest.mark.parametrize("echoes", [0, 4, 400])
def test_silences_are_kept_where_they_are_the_newest(echoes: int) -> None:
    """Otherwise an object that was heard all round and carried away would come back from the archive."""
    memory, one = filled(3, echoes), zeros(Reading, 1)
    track = memory.tracks[0]
    for turn in np.repeat([0.1, 0.9, 1.7, 2.5], 6).tolist():
        c, s = np.cos(turn), np.sin(turn)
        one[0] = (track.x + 2.0 * c, track.y + 2.0 * s, -c, -s, np.inf, 0.0, 0.0)
        reservoir.keep_reading(track, track.x, track.y, records(Reading, one)[0])
    assert np.isinf(newest_readings(memory.circles["bins"][0])["range_m"][:4]).all()


def test_bearings_are_those_of_the_reservoir() -> None:
    rng = np.random.default_rng(3)
    places = rng.normal(size=(200, 2))
    memory = new_memory()
    track, one = memory.tracks[0], zeros(Reading, 1)
    for place, b in zip(places.tolist(), bearing_bins(places, BEARING_BINS).tolist(), strict=True):
        before = memory.circles["bins"]["count"][0].copy()
        one["x"], one["y"] = place
        reservoir.keep_reading(track, 0.0, 0.0, records(Reading, one)[0])
        assert np.flatnonzero(memory.circles["bins"]["count"][0] - before).tolist() == [b]


def test_a_polygon_comes_back_too() -> None:
    memory = new_memory()
    track = memory.polygons[0]
    track["x"], track["y"], track["heading"], track["number"], track["covariance"]["hh"] = 3.0, -2.0, 0.7, 12, 0.01
    track["bins"]["count"][5] = 1
    track["bins"]["readings"][5, 0] = (1.0, 0.5, 0.6, 0.8, 2.5, 0.0, 0.0)
    unpack(pack(memory.polygons[:1], archived_dtype(PolygonTrack), is_reported=False), memory.polygons[-1:])
    back = memory.polygons[-1]
    assert (back["x"], back["heading"], back["number"], back["covariance"]["hh"]) == (3.0, 0.7, 12, 0.01)
    assert back["bins"]["count"].sum() == 1


def test_an_archived_object_takes_less_than_2_kb() -> None:
    assert max(archived_dtype(kind).itemsize for kind in (CircleTrack, PolygonTrack)) < BYTES_MAX


def test_cross_paths_are_left_out_of_an_archived_track() -> None:
    memory, one = filled(3, 0), zeros(Reading, 1)
    track = memory.tracks[0]
    for k in range(30):
        one[0] = (track.x + 2.0, track.y, -1.0, 0.0, 1.0 + k, 0.1 * (k % 3), 0.0)
        reservoir.keep_reading(track, track.x, track.y, records(Reading, one)[0])
    kept = newest_readings(memory.circles["bins"][0])
    assert kept["range_m"].tolist() == [1.0 + k for k in range(29, 9, -1) if k % 3 == 0]


@pytest.mark.parametrize("kind", [CircleTrack, PolygonTrack])
def test_an_archived_track_moves_with_its_map_of_the_way_and_its_readings_stay_about_it(
    kind: type[CircleTrack] | type[PolygonTrack],
) -> None:
    rows, turn = np.zeros(2, archived_dtype(kind)), 0.3
    rows["x"], rows["y"], rows["submap"] = 2.0, 1.0, (0, 1)
    rows["kept"], rows["readings"][:, 0] = 1, (0.5, 0.0, 0.1, 0.4)
    before = rows.copy()
    move_rows(rows, MapMoves(np.array([[0.0, 0.0, 0.0], [0.5, -0.5, turn]]), np.zeros((2, 2))))
    assert rows[0] == before[0]
    to = Pose(0.5, -0.5, turn)
    centre, sensor = to.compose(Pose(2.0, 1.0, 0.0)), to.compose(Pose(2.5, 1.0, 0.1))
    assert (rows["x"][1], rows["y"][1]) == pytest.approx((centre.x, centre.y))
    x, y, axis, range_m = rows["readings"][1, 0].tolist()
    assert (centre.x + x, centre.y + y) == pytest.approx((sensor.x, sensor.y), abs=1e-6)
    assert (axis, range_m) == pytest.approx((sensor.theta, 0.4), abs=1e-6)
    if kind is PolygonTrack:
        assert rows["heading"][1] == rows["challenger"]["heading"][1] == turn
