"""No robot enters a no-go area or crosses a line, whatever is asked of it; one inside comes out."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from behaviors import no_go
from behaviors.no_go import MARGIN_M, Zones, limited, no_go_at, side_distances_m, with_no_go, zones_of
from config.places import NoGoAreaConfig, NoGoLineConfig, PlacesConfig, SpeedAreaConfig
from config.robot import BodyConfig
from perception.percept import Floats, OccupancyWindow, Percept, Pose, Twist
from tests.behaviors.views import EVERYWHERE

STEP_S = 0.01
CYCLE = 5
"""Steps of the base's own loop in a cycle."""


def square(x: float, y: float, half: float) -> NoGoAreaConfig:
    """Return a square no-go area."""
    return NoGoAreaConfig(
        vertices_m=((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
    )


class Base:
    """A base with limited accelerations that follows a command a cycle late."""

    def __init__(self, pose: Pose, body: BodyConfig) -> None:
        self.pose, self.body, self.moving, self.late = pose, body, Twist(0.0, 0.0), Twist(0.0, 0.0)

    def drive(self, command: Twist) -> None:
        """Drive for one cycle."""
        body, wanted = self.body, self.late
        self.late = command
        for _ in range(CYCLE):
            dv = body.acceleration_max_m_s2 * STEP_S
            dw = body.turn_acceleration_max_rad_s2 * STEP_S
            v = self.moving.v + min(dv, max(-dv, wanted.v - self.moving.v))
            w = self.moving.w + min(dw, max(-dw, wanted.w - self.moving.w))
            self.moving = Twist(v, w)
            middle = self.pose.theta + 0.5 * w * STEP_S
            self.pose = Pose(
                self.pose.x + v * STEP_S * math.cos(middle), self.pose.y + v * STEP_S * math.sin(middle),
                self.pose.theta + w * STEP_S,
            )  # fmt: skip


def gap_m(zones: Zones, pose: Pose, body: BodyConfig) -> float:
    """Return the least distance from the rim to any no-go zone, by sampling, independent of the code under test."""
    return min(_distance_m(zone.ends, pose, is_area=zone.is_area) for zone in zones.no_go) - body.radius_m


def _distance_m(ends: np.ndarray, pose: Pose, *, is_area: bool) -> float:
    best, winding = math.inf, 0.0
    for x1, y1, x2, y2 in ends.tolist():
        for k in range(101):
            best = min(best, math.dist((x1 + (x2 - x1) * k / 100, y1 + (y2 - y1) * k / 100), (pose.x, pose.y)))
        a, b = math.atan2(y1 - pose.y, x1 - pose.x), math.atan2(y2 - pose.y, x2 - pose.x)
        winding += (b - a + math.pi) % (2 * math.pi) - math.pi
    return -best if is_area and abs(winding) > math.pi else best


def random_places(rng: np.random.Generator) -> PlacesConfig:
    """Return up to four areas and lines, star-shaped or crossing themselves."""
    areas, lines = [], []
    for _ in range(rng.integers(1, 5)):
        x, y, size = *rng.uniform(-3.0, 3.0, 2), rng.uniform(0.2, 1.5)
        turns = np.sort(rng.uniform(0.0, 2 * math.pi, rng.integers(3, 7)))
        corners = tuple((x + size * math.cos(a), y + size * math.sin(a)) for a in turns.tolist())
        if rng.random() < 0.3:
            lines.append(NoGoLineConfig(points_m=corners[: rng.integers(2, len(corners) + 1)]))
        else:
            areas.append(NoGoAreaConfig(vertices_m=corners))
    return PlacesConfig(no_go_area=tuple(areas), no_go_line=tuple(lines))


def random_body(rng: np.random.Generator) -> BodyConfig:
    """Return a base as they are built: small and nimble to heavy and fast."""
    return BodyConfig(
        radius_m=float(rng.uniform(0.1, 0.5)), speed_max_m_s=float(rng.uniform(0.2, 1.5)),
        turn_max_rad_s=float(rng.uniform(0.5, 3.0)), acceleration_max_m_s2=float(rng.uniform(0.3, 2.0)),
        turn_acceleration_max_rad_s2=float(rng.uniform(1.0, 6.0)),
    )  # fmt: skip


def worst_gap_m(seed: int, cycles: int = 400) -> float:
    """Return how near the rim of a random robot comes to random zones under random commands, m."""
    rng = np.random.default_rng(seed)
    zones, body = zones_of(random_places(rng)), random_body(rng)
    start = zones.no_go[0].ends[0]
    while gap_m(zones, Pose(start[0], start[1], 0.0), body) < MARGIN_M:
        start = rng.uniform(-4.0, 4.0, 2)
    base, asked, least = (
        Base(Pose(float(start[0]), float(start[1]), rng.uniform(-math.pi, math.pi)), body),
        Twist(0.0, 0.0),
        math.inf,
    )
    for k in range(cycles):
        if k % int(rng.integers(3, 40)) == 0:
            towards = zones.no_go[rng.integers(len(zones.no_go))]
            x, y = towards.ends[:, 0].mean() - base.pose.x, towards.ends[:, 1].mean() - base.pose.y
            turn = (math.atan2(y, x) - base.pose.theta + math.pi) % (2 * math.pi) - math.pi
            w = float(np.clip(rng.choice([turn, rng.normal(0.0, 2.0)]), -body.turn_max_rad_s, body.turn_max_rad_s))
            asked = Twist(float(rng.choice([1.0, 1.0, rng.uniform(-1.0, 1.0)])) * body.speed_max_m_s, w)
        twist, _ = limited(asked, base.late, base.moving, base.pose, zones, body, 2.0 * CYCLE * STEP_S)
        base.drive(twist)
        least = min(least, gap_m(zones, base.pose, body))
    return least


@pytest.mark.parametrize("seed", range(2))
def test_no_velocity_leads_into_a_zone(seed: int) -> None:
    assert worst_gap_m(seed) > 0.0


EVALUATIONS_MAX = 8
"""Ways of braking that are looked at in a cycle: as asked, standing, and then six turns or four speeds."""
PLACES_MAX = 2 * 3 * 20
"""On each of them: places from two speeds, by three turns."""


def test_the_work_of_a_cycle_is_bounded_by_the_sides_that_are_near(
    monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    """Beside twenty lines of a hundred corners each, of which the robot can reach some corners."""
    points = [(0.25 * k, 0.5 + 0.3 * math.sin(k)) for k in range(100)]
    lines = [NoGoLineConfig(points_m=tuple((x, y + 2.0 * i) for x, y in points)) for i in range(20)]
    body = BodyConfig(radius_m=0.25, speed_max_m_s=1.0, turn_max_rad_s=1.5, acceleration_max_m_s2=0.5)
    zones, pairs = zones_of(PlacesConfig(no_go_line=tuple(lines))), list[int]()

    def counted(ends: Floats, points: Floats) -> Floats:
        pairs[-1] += len(ends) * (points.size // 2)
        return side_distances_m(ends, points)

    monkeypatch.setattr(no_go, "side_distances_m", counted)
    sides, near_max, rng = sum(len(zone.ends) for zone in zones.no_go), 0, np.random.default_rng(0)
    for _ in range(200):
        x, y, theta = rng.uniform((0.0, -1.0, -3.0), (24.0, 1.0, 3.0)).tolist()
        pose = Pose(x, y, theta)
        asked, last, moving = (Twist(*rng.uniform(-1.0, 1.0, 2).tolist()) for _ in range(3))
        pairs.append(0)
        limited(asked, last, moving, pose, zones, body, 0.15)
        fastest = max(abs(twist.v) for twist in (asked, last, moving))
        reach_m = body.radius_m + MARGIN_M + 0.15 * fastest + 0.5 * fastest**2 / body.acceleration_max_m_s2
        ends = np.concatenate([zone.ends for zone in zones.no_go])
        near = int((side_distances_m(ends, np.array((pose.x, pose.y))) < reach_m).sum())
        near_max = max(near_max, near)
        assert pairs[-1] <= EVALUATIONS_MAX * PLACES_MAX * near + sides + near
    assert near_max > 3
    measured(
        f"{len(lines)} lines of {sides} sides: at most {max(pairs):,} distances in a cycle, {near_max} sides near"
    )


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2, 312))
def test_no_velocity_leads_into_a_zone_in_many_drives(seed: int) -> None:
    assert worst_gap_m(seed) > 0.0


BODY = BodyConfig(radius_m=0.3, speed_max_m_s=0.5, turn_max_rad_s=1.5)


def allowed(asked: Twist, pose: Pose, places: PlacesConfig) -> Twist:
    """Return what is left of a velocity of a base that stands."""
    return limited(asked, Twist(0.0, 0.0), Twist(0.0, 0.0), pose, zones_of(places), BODY, 0.1)[0]


def test_a_robot_inside_may_come_out_and_not_go_deeper() -> None:
    places = PlacesConfig(no_go_area=(square(0.0, 0.0, 1.0),))
    inside = Pose(0.8, 0.0, 0.0)
    assert allowed(Twist(0.3, 0.0), inside, places) == Twist(0.3, 0.0)
    assert allowed(Twist(-0.3, 0.0), inside, places).v == 0.0
    assert allowed(Twist(0.0, 1.0), inside, places) == Twist(0.0, 1.0)


def test_a_robot_drives_along_a_line_as_near_as_it_stands() -> None:
    places = PlacesConfig(no_go_line=(NoGoLineConfig(points_m=((-9.0, 0.0), (9.0, 0.0))),))
    beside = Pose(0.0, BODY.radius_m + MARGIN_M, 0.0)
    assert allowed(Twist(0.5, 0.0), beside, places) == Twist(0.5, 0.0)
    assert allowed(Twist(0.5, -0.5), beside, places).v < 0.1
    assert allowed(Twist(0.5, 0.5), beside, places) == Twist(0.5, 0.5)


def test_the_speed_has_come_down_when_the_rim_reaches_a_speed_area() -> None:
    corners = square(2.0, 0.0, 1.0).vertices_m
    places = PlacesConfig(speed_area=(SpeedAreaConfig(vertices_m=corners, speed_max_m_s=0.1),))
    base, zones = Base(Pose(-1.0, 0.0, 0.0), BODY), zones_of(places)
    for _ in range(400):
        twist, by = limited(Twist(0.5, 0.0), base.late, base.moving, base.pose, zones, BODY, 0.1)
        assert by is None
        base.drive(twist)
        if 1.0 - BODY.radius_m < base.pose.x < 3.0:
            assert base.moving.v < 0.11
    assert base.pose.x > 1.5


def test_lines_are_obstacles_for_schemas_but_not_those_that_the_robot_overlaps() -> None:
    frame = Pose(5.0, -2.0, 0.7)
    window = OccupancyWindow(np.full((64, 64), 0.5, np.float32), 2.0, -5.0, 0.1)
    at = frame.compose(Pose(0.0, 0.0, 0.3))
    percept = Percept(at, np.zeros((0, 2)), EVERYWHERE, occupancy=window, steady=np.zeros((0, 2)))
    line = NoGoLineConfig(points_m=((1.0, -5000.0), (1.0, 5000.0)))
    seen = with_no_go(percept, zones_of(PlacesConfig(no_go_line=(line,))), frame, 0.3)
    assert seen.steady is not None
    assert seen.occupancy is not None
    assert len(seen.obstacles) == len(seen.steady) > 10
    near = [frame.inverse().compose(Pose(x, y, 0.0)) for x, y in seen.obstacles.tolist()]
    assert all(abs(point.x - 1.0) < 1e-9 and abs(point.y) < 3.0 for point in near)
    assert 20 < (seen.occupancy.occupied == 1.0).sum() < 64 * 3
    inside = with_no_go(percept, zones_of(PlacesConfig(no_go_area=(square(0.2, 0.0, 1.0),))), frame, 0.3)
    assert inside is percept


def test_a_goal_in_an_area_is_named() -> None:
    zones = zones_of(PlacesConfig(no_go_area=(square(0.0, 0.0, 1.0),)))
    assert no_go_at(zones, 1.2, 0.0, 0.3) == "the no-go area 1"
    assert no_go_at(zones, 1.4, 0.0, 0.3) is None
