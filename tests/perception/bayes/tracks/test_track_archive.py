"""Which tracks are worked on, and what becomes of the others: drives with room for eight tracks only."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from config.world import AcousticsConfig, DrumConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.memory.state import FREE
from perception.bayes.tracks.model_check import is_careful
from perception.bayes.tracks.refine import refine
from perception.bayes.tracks.track_archive import HELD_SHARE, LOOK_M, TrackArchive
from perception.detected_object import DetectedObject
from perception.edits import ClearMap, ConfirmObject, MoveObject, PlaceModel, RemoveObject
from perception.map_moves import MapMoves
from perception.snapshot import put_back, snapshot_of
from tests.naive_tracks import FT
from tests.perception.bayes.random_tracks import SETTINGS

TRACKS = 8
NEAR_M = 0.1
LENGTH_M = 24.0
STEP_M = 0.04
Places = list[tuple[float, float]]


def hall(length_m: float, spacing_m: float = 3.0) -> Places:
    """Return the places of drums on both sides of a hall, m."""
    xs = np.arange(0.0, length_m, spacing_m).tolist()
    return [(x + 0.3 * side, side * (1.5 + 0.1 * (k % 3))) for k, x in enumerate(xs) for side in (-1.0, 1.0)]


def drive(drums: Places, xs: list[float], begin_s: float = 0.0) -> Iterator[Firing]:
    """Yield the firings of octets at these places along the hall."""
    world = WorldConfig(drum=tuple(DrumConfig(x_m=x, y_m=y, radius_m=FT) for x, y in drums))
    sonar = Sonar(SETTINGS.ring, compile_scene(world), world.acoustics, np.random.default_rng(0))
    for k, x in enumerate(xs):
        pose = Pose(x, 0.0, 0.0)
        yield Firing(begin_s + 0.05 * k, pose, 0.0, sonar.fire(pose, 0.0, [i for i in range(24) if i % 3 == k % 3]))


def way(begin_m: float, end_m: float) -> list[float]:
    return [float(x) for x in np.linspace(begin_m, end_m, 1 + round(abs(end_m - begin_m) / STEP_M))]


def small(tracks: int = TRACKS) -> BayesPerception:
    config = SETTINGS.perception.bayes.model_copy(update={"tracks_max": tracks})
    return BayesPerception(SETTINGS.ring, SETTINGS.models, config)


def see(perception: BayesPerception, firings: Iterator[Firing], then: Callable[[], None] = lambda: None) -> None:
    for firing in firings:
        perception.observe(firing)
        while perception.can_refine:
            perception.refine()
        then()


def at(objects: tuple[DetectedObject, ...], place: tuple[float, float]) -> DetectedObject | None:
    found = [seen for seen in objects if math.dist((seen.x, seen.y), place) < NEAR_M]
    assert len(found) <= 1, "reported twice"
    return found[0] if found else None


@pytest.fixture(scope="module")
def seen_once() -> tuple[BayesPerception, Places]:
    perception, drums = small(), hall(LENGTH_M)
    see(perception, drive(drums, way(-1.0, LENGTH_M)))
    return perception, drums


@pytest.fixture
def there(seen_once: tuple[BayesPerception, Places]) -> tuple[BayesPerception, Places]:
    """Perception at the end of a hall of twice as many drums as it has tracks; a copy."""
    perception = small()
    put_back(perception, snapshot_of(seen_once[0]))
    perception.drop_caches()
    return perception, seen_once[1]


@pytest.mark.compiled
@pytest.mark.promise("P23")
def test_a_hall_of_more_drums_than_tracks_is_reported_whole_and_keeps_its_numbers_on_the_way_back(
    there: tuple[BayesPerception, Places], measured: Callable[[str], None]
) -> None:
    perception, drums = there
    before = {number: at(perception.objects(), place) for number, place in enumerate(drums)}
    assert all(before.values())
    assert len(perception.objects()) == len(drums) > TRACKS
    numbers = {number: seen.number for number, seen in before.items() if seen}
    most = 0

    def look() -> None:
        nonlocal most
        held = [seen.number for seen in perception.objects()]
        assert len(held) == len(set(held)), "an object is near and left behind"
        most = max(most, len(perception.near_objects()))

    see(perception, drive(drums, way(LENGTH_M, -1.0), 100.0), look)
    after = {k: at(perception.objects(), place) for k, place in enumerate(drums)}
    assert len(perception.objects()) == len(drums)
    assert {k: seen.number for k, seen in after.items() if seen} == numbers
    assert most <= TRACKS
    worst = max(math.dist((seen.x, seen.y), drums[k]) for k, seen in after.items() if seen)
    assert worst < 0.05 * FT, "as exact as with room for all"
    measured(
        f"{len(drums)} drums with {TRACKS} tracks, there and back: all reported, worst error {worst / FT:.3f} ft"
    )
    assert perception.counts.archived == len(drums) - len(perception.near_objects())
    assert len(perception.archived_objects()) >= perception.counts.archived - perception.counts.waiting


@pytest.mark.compiled
@pytest.mark.promise("P23")
def test_a_restored_snapshot_goes_on_with_the_same_results(there: tuple[BayesPerception, Places]) -> None:
    perception, drums = there
    other = small()
    put_back(other, snapshot_of(perception))
    other.drop_caches()
    firings = list(drive(drums, way(LENGTH_M, LENGTH_M / 2), 100.0))
    for one in (perception, other):
        see(one, iter(firings))
    mine, others = snapshot_of(perception), snapshot_of(other)
    assert perception.objects() == other.objects()
    assert all(mine[name].tobytes() == others[name].tobytes() for name in mine if ".scratch" not in name)


@pytest.mark.compiled
@pytest.mark.promise("P23")
def test_what_was_left_behind_can_be_looked_at_and_edited(there: tuple[BayesPerception, Places]) -> None:
    perception, drums = there
    first, second, third = (at(perception.archived_objects(), place) for place in drums[:3])
    assert first is not None
    assert second is not None
    assert third is not None
    assert first.number
    assert second.number
    assert third.number
    before = snapshot_of(perception)
    found = perception.evidence(first.number)
    assert found is not None
    assert found.supporting > 0.0
    assert all(before[name].tobytes() == array.tobytes() for name, array in snapshot_of(perception).items())
    assert perception.edit(ConfirmObject(first.number)) is None
    assert perception.edit(RemoveObject(second.number)) is None
    assert perception.edit(MoveObject(third.number, third.x + 1.0, third.y, 0.0)) is None
    see(perception, drive(drums, way(LENGTH_M, LENGTH_M + 2.0 * LOOK_M), 100.0))
    now = {seen.number: seen for seen in perception.objects()}
    assert now[first.number].confirmed
    assert second.number not in now
    assert now[third.number].x == pytest.approx(third.x + 1.0, abs=0.3)
    assert perception.evidence(10_000) is None
    assert perception.edit(ClearMap()) is None
    assert perception.objects() == perception.archived_objects() == ()
    assert perception.counts.archived == 0


@pytest.mark.compiled
@pytest.mark.promise("P23")
def test_where_more_is_near_than_fits_the_farthest_wait_and_are_counted() -> None:
    perception = small()
    places = [(3.0 * math.cos(turn), 3.0 * math.sin(turn)) for turn in np.linspace(0.0, 5.6, TRACKS).tolist()]
    far = (6.0, 0.2)
    for x, y in (far, *places):
        assert perception.edit(PlaceModel(SETTINGS.models[0].name, x, y, 0.0)) is None
        see(perception, drive([], [0.0]))
    room = int(HELD_SHARE * TRACKS)
    see(perception, drive([], way(0.0, 0.5 * LOOK_M)))
    assert perception.counts.waiting == perception.counts.archived == 1 + len(places) - room
    assert len(perception.objects()) == 1 + len(places), "none is lost"
    assert at(perception.archived_objects(), far)
    assert np.count_nonzero(perception.memory.circles["status"] != FREE) <= TRACKS
    perception.reset()
    assert perception.counts.waiting == 0


@pytest.mark.compiled
def test_what_was_left_behind_moves_with_its_map_of_the_way(there: tuple[BayesPerception, Places]) -> None:
    perception, drums = there
    archive = perception._archive
    before = {seen.number: seen for seen in perception.archived_objects()}
    assert perception.archived_objects() is perception.archived_objects()
    rows = archive.circles.held()
    rows["submap"] = np.arange(len(rows)) % 2
    moved = {int(row["number"]) for row in rows if row["submap"] == 1}
    perception.memory.state["room"]["remembered_count"] = 1
    moves = MapMoves(np.array([[0.0, 0.0, 0.0], [0.0, 0.25, 0.0]]), np.zeros((2, 2)))
    perception.follow_maps(3, moves)
    assert archive.submap == 3
    assert perception.memory.state["room"]["remembered_count"] == 1
    for seen in perception.archived_objects():
        off = seen.y - before[seen.number].y
        assert off == pytest.approx(0.25 if seen.number in moved else 0.0), seen
    number = min(moved)
    row = archive.circles.find(number)
    assert row is not None
    assert number in archive.circles.near(float(row["x"][0]), float(row["y"][0]), 0.01)
    assert len(drums) > len(moved) > 0
    perception.follow_maps(3, moves._replace(is_first=True))
    assert perception.memory.state["room"]["remembered_count"] == 0


def test_a_drum_that_was_left_behind_keeps_its_name_where_everything_echoes() -> None:
    """Its archived readings bear the check of its outline, without which such a place names no drum."""
    acoustics, rng = AcousticsConfig(model="cone", noise_relative=0.01), np.random.default_rng(0)
    world = WorldConfig(drum=(DrumConfig(x_m=0.0, y_m=0.0, radius_m=FT),), acoustics=acoustics)
    sonar, perception = Sonar(SETTINGS.ring, compile_scene(world), acoustics, rng), small()
    for k in range(300):  # round it twice, at 1.2 and 1.5 m
        turn, away_m = math.tau * k / 150, 1.2 if k < 150 else 1.5
        pose = Pose(away_m * math.cos(turn), away_m * math.sin(turn), turn)
        ranges = sonar.fire(pose, 0.0, [i for i in range(24) if i % 3 == k % 3])
        see(perception, iter([Firing(0.05 * k, pose, 0.0, ranges)]))
    (track,) = np.flatnonzero(perception.memory.circles["is_named"]).tolist()
    archive = TrackArchive()
    archive._kinds(perception.memory, perception.settings, 0.9)[0].put_away(track)
    (number,) = archive.circles.held()["number"].tolist()
    archive.take_up(perception.memory, perception.settings, 0.9, number)
    (track,) = np.flatnonzero(perception.memory.circles["number"] == number).tolist()
    perception.memory.state["silent"], perception.memory.state["heard"] = 0.0, 1000.0
    circle = perception.memory.tracks[track]
    for _ in range(8):
        refine(perception.memory.s, perception.memory.tracks, perception.settings, track)
    assert is_careful(perception.memory.s, perception.memory.tracks, perception.settings)
    assert (circle.is_named, circle.outline_lead < -3.0) == (1, True)
