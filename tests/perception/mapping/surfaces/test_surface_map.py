"""The map of surfaces in rooms that are generated here, and as a part of perception: exact continuation, standing."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject, wall_between
from perception.mapping.no_surfaces import SurfaceReport
from perception.mapping.surfaces.quantum import CLEAR, search_is_due
from perception.mapping.surfaces.surface_map import SurfaceMap
from perception.pipeline import Perception
from perception.snapshot import bounds_of, numbers_of, put_back, snapshot_of

pytestmark = pytest.mark.compiled

WALLS = np.array([(-3.0, -2.0, 3.0, -2.0), (3.0, -2.0, 3.0, 2.0), (3.0, 2.0, 0.5, 2.0), (-0.5, 2.0, -3.0, 2.0),
                  (-3.0, 2.0, -3.0, -2.0), (0.4, 0.2, 0.7, 0.2)])  # fmt: skip
"""A room with a doorway, and a box's side in it."""
SIDES = 12
HALF = math.radians(12.0)


def perception_settings() -> Settings:
    """Return settings with a ring of twelve sensors, without models, that map surfaces always."""
    loaded = load_settings()
    sensors = [{"x_m": 0.0, "y_m": 0.0, "angle_deg": 360.0 / SIDES * k} for k in range(SIDES)]
    ring = loaded.ring.model_validate(
        {
            "sensors": sensors,
            "beam_half_angle_deg": 12.0,
            "resolution_m": 0.01,
            "range_min_m": 0.1,
            "range_max_m": 5.0,
        }
    )
    return loaded.model_copy(update={"ring": ring, "models": ()}).of_log()


def hear(pose: Pose) -> np.ndarray:
    """Return the range to the nearest point of the walls in each beam, in whole centimetres."""
    shares = np.linspace(0.0, 1.0, 400)[:, None, None]
    points = (WALLS[:, :2] + shares * (WALLS[:, 2:] - WALLS[:, :2])).reshape(-1, 2) - (pose.x, pose.y)
    away, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    ranges = np.full(SIDES, math.inf)
    for k in range(SIDES):
        off = np.abs(np.angle(np.exp(1j * (bearing - pose.theta - 2.0 * math.pi * k / SIDES))))
        if (off < HALF).any():
            ranges[k] = round(float(away[off < HALF].min()), 2)
    return ranges


def drive(count: int, begin: int = 0) -> list[Firing]:
    """Return firings on a way through the room, seven centimetres apart."""
    firings = []
    for n in range(begin, begin + count):
        a = 0.05 * n
        pose = Pose(1.8 * math.cos(a), 1.1 * math.sin(a), a + 1.5)
        firings.append(Firing(0.1 * n, pose, pose.theta, hear(pose)))
    return firings


def run(perception: Perception, firings: list[Firing]) -> None:
    for firing in firings:
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass


@pytest.fixture(scope="module")
def driven() -> Perception:
    settings = perception_settings()
    perception = Perception(settings.ring, settings.models, settings.perception)
    run(perception, drive(130))
    perception.surfaces.finish()
    return perception


def test_walls_and_what_is_not_one_are_mapped(driven: Perception) -> None:
    """Each wall is reported along most of its length, the doorway stays open, and the box's side is on the map.

    The side may be a polyline, or its edges and what stands between them.
    """
    seen = driven.labelled_objects()
    walls = [one.ends for one in seen if one.ends is not None]
    points = [(one.x, one.y) for one in seen if one.ends is None]
    parts = [np.column_stack([one.points[:-1], one.points[1:]]) for one in driven.polylines()]
    pieces = np.concatenate([np.array(walls).reshape(-1, 4), *parts])
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    mapped = np.concatenate([(pieces[:, :2] + shares * (pieces[:, 2:] - pieces[:, :2])).reshape(-1, 2), points])
    for wall in WALLS:
        along = wall[:2] + np.linspace(0.05, 0.95, 60)[:, None] * (wall[2:] - wall[:2])
        nearest = np.hypot(*(along[:, None] - mapped).transpose(2, 0, 1)).min(axis=1)
        assert (nearest < 0.1).mean() > 0.8, wall
    assert np.hypot(*(mapped - (0.0, 2.0)).T).min() > 0.15


def test_a_robot_that_stands_adds_nothing(driven: Perception) -> None:
    assert isinstance(driven.surfaces, SurfaceMap)
    search = driven.surfaces._search
    firing = drive(1, 129)[0]
    before = int(search.room[0].count)
    for _ in range(5):
        driven.observe(firing)
    assert search.room[0].count <= before + SIDES
    assert not search_is_due(search.room)


def test_a_report_changes_only_with_what_is_free(driven: Perception) -> None:
    """A known wall that moves by a millimetre lies along the same: the report is not made again."""
    surfaces = driven.surfaces
    assert isinstance(surfaces, SurfaceMap)

    def beside(*known: DetectedObject) -> SurfaceReport:
        return surfaces.report(lambda: known)

    without = beside()
    one, other = (wall_between((-3.0, -2.0 + off, 3.0, -2.0 + off), 1e-4, 1e-4, 50, 9.0) for off in (0.0, 0.001))
    covered = beside(one)
    assert covered is not without
    assert beside(other) is covered
    assert [wall.ends for wall in beside().walls] == [wall.ends for wall in without.walls]


def test_pieces_stand_for_the_walls_of_a_place_that_is_not_known(driven: Perception) -> None:
    """The method's walls along them are not shown, near the robot and left behind; its other objects are."""
    surfaces = driven.surfaces
    assert isinstance(surfaces, SurfaceMap)
    wall = wall_between((-3.0, -2.0, 3.0, -2.0), 1e-4, 1e-4, 50, 9.0, 5)
    post = DetectedObject("post", 1.0, 1.0, 0.0, 0.01, 9, 1.0)
    report = surfaces.report(lambda: (wall, post))
    assert report.walls
    assert report.shown((wall, post)) == (post,)
    archived = (post, wall)
    left = surfaces.archived_shown(archived, lambda: (wall, post))
    assert left == (post,)
    assert surfaces.archived_shown(archived, lambda: (wall, post)) is left
    surfaces.set_models(load_settings("hallway").models)
    drum = DetectedObject("drum", -2.5, 0.0, 0.0, 0.01, 9, 0.99, 0.99, number=7)
    assert surfaces.report(lambda: (drum, post)).shown((drum, post)) == (post,)
    surfaces.set_models(())
    settings = perception_settings()
    nothing = SurfaceMap(settings.ring, settings.models, settings.perception.surfaces)
    assert nothing.report(lambda: (wall, drum)).shown((wall, drum)) == (wall, drum)
    assert nothing.archived_shown(archived, lambda: archived) is archived


def test_what_lies_on_a_barrel_is_no_wall(driven: Perception) -> None:
    """A round object without a model's name has an outline, too: the box's side would be a part of it."""
    surfaces = driven.surfaces
    assert isinstance(surfaces, SurfaceMap)
    barrel = DetectedObject("barrel", 0.55, 0.87, 0.0, 0.01, 90, 0.99, 1.0 - 1e-15, number=3)

    def lies_at_the_side(report: SurfaceReport) -> bool:
        lines = [np.array(wall.ends).reshape(2, 2) for wall in report.walls if wall.ends is not None]
        return any(np.hypot(*(line.mean(axis=0) - (0.55, 0.2))).min() < 0.2 for line in lines)

    assert lies_at_the_side(surfaces.report(tuple))
    assert not lies_at_the_side(surfaces.report(lambda: (barrel,)))


def test_perception_continues_from_a_snapshot_to_the_bit() -> None:
    """At many moments: while readings are entered, shared again, and in each step of a search."""
    settings = perception_settings()
    ours = Perception(settings.ring, settings.models, settings.perception)
    steps = set()
    for k, firing in enumerate(drive(60)):
        ours.observe(firing)
        assert isinstance(ours.surfaces, SurfaceMap)
        for _ in range(40):
            if ours.can_refine:
                ours.refine()
                steps.add(int(ours.surfaces._search.room[0].phase))
        if k % 6 == 5:
            other = Perception(settings.ring, settings.models, settings.perception)
            other.restore(ours.snapshot())
            for later in drive(3, k + 1):
                for one in (ours, other):
                    one.observe(later)
                    while one.can_refine:
                        one.refine()
            mine, theirs = ours.snapshot(), other.snapshot()
            for name, array in mine.items():
                assert array.tobytes() == theirs[name].tobytes(), name
            assert ours.polylines() == () or len(ours.polylines()) == len(other.polylines())
    assert len(steps) >= 4


def test_a_robot_that_goes_away_begins_another_local_map_and_keeps_what_it_found() -> None:
    settings = perception_settings()
    perception = Perception(settings.ring, settings.models, settings.perception)
    run(perception, drive(130))
    perception.surfaces.finish()
    surfaces = perception.surfaces
    assert isinstance(surfaces, SurfaceMap)
    before = len(surfaces._list.archived_rows)
    silent = np.full(SIDES, math.inf)
    run(perception, [Firing(20.0 + k, Pose(0.5 * k, 0.0, 0.0), 0.0, silent) for k in range(40)])
    assert before > 0
    assert len(surfaces._list.left_behind) > 0.9 * before
    assert surfaces._search.centre[0] > 9.0


def test_nothing_is_mapped_in_a_run_unless_the_settings_say_so() -> None:
    settings = load_settings()
    assert Perception(settings.ring, settings.models, settings.perception).polylines() == ()
    made = Perception(settings.ring, settings.models, settings.of_log().perception)
    assert isinstance(made.surfaces, SurfaceMap)
    made.observe(Firing(0.0, Pose(math.nan, 0.0, 0.0), 0.0, np.full(len(settings.ring.mounts), 1.0)))
    assert made.polylines() == ()
    made.reset()
    assert made.surfaces.converged


@pytest.fixture(scope="module")
def moments() -> list[SurfaceMap]:
    """Return a map in each phase of its work."""
    settings = perception_settings()
    surfaces, found = SurfaceMap(settings.ring, (), settings.perception.surfaces), dict[int, SurfaceMap]()
    silent = np.full(SIDES, math.inf)
    away = [Firing(20.0 + k, Pose(0.5 * k, 0.0, 0.0), 0.0, silent) for k in range(40)]
    for firing in drive(100) + away:
        surfaces.observe(firing)
        while surfaces.can_refine:
            phase = int(surfaces._search.local["phase"][0])
            if phase not in found and surfaces._list.numbered > 0:
                found[phase] = copy.deepcopy(surfaces)
            surfaces.refine()
    return list(found.values())


def is_refused(surfaces: SurfaceMap, name: str, number: float, firings: list[Firing]) -> bool:
    """Put a number everywhere into a field of a map's state, and go on; return whether that ends in an error."""
    snapshot = snapshot_of(surfaces)
    values = dict(numbers_of(snapshot))[name]
    values[...] = number if values.dtype.kind == "f" else int(number)
    settings = perception_settings()
    other = SurfaceMap(settings.ring, (), settings.perception.surfaces)
    try:
        put_back(other, snapshot)
        other.drop_caches()
        for firing in firings:
            while other.can_refine:
                other.refine()
            other.observe(firing)
    except (ArithmeticError, LookupError, ValueError) as error:
        if str(error) == "index is out of bounds":
            raise
        return True
    return False


@pytest.mark.boundslong
@pytest.mark.parametrize("share", [6, pytest.param(1, marks=pytest.mark.soak)])
def test_each_number_has_a_bound_within_which_it_is_harmless(moments: list[SurfaceMap], share: int) -> None:
    """A state from a file may have any value within the bounds: no kernel leaves an array for it.

    The short form has each sixth number, another one in each moment.
    """
    assert len(moments) == CLEAR + 1
    bounds, firings = bounds_of(moments[0]), drive(2, 160)
    outcomes = [
        is_refused(moment, name, number, firings)
        for k, moment in enumerate(moments)
        for i, (name, values) in enumerate(numbers_of(snapshot_of(moment)), k)
        if i % share == 0
        if values.dtype.kind != "b" and not bounds[name].constant
        # A whole number may be an index: both ends. Of the others one end in every fourth moment, in turns.
        if values.dtype.kind != "f" or i % 4 == 0
        for number in (bounds[name][:2] if values.dtype.kind != "f" else (bounds[name][i // 4 % 2],))
    ]
    assert outcomes.count(True) < 0.1 * len(outcomes)
