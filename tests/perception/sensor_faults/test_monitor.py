"""P8: faulty sensors are detected and masked; healthy ones never are, in any hall."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
import pytest

from config.load import load_settings
from config.robot import FiringConfig, Preset, RingConfig
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import CrossPaths, Firing, Pose
from perception.pipeline import Perception
from perception.sensor_faults.monitor import SensorMonitor
from perception.sensor_faults.reading_tests import MISSED_FIRINGS_MAX, RECOVERY_READINGS
from perception.sensor_faults.report import SensorFault
from runtime.simulation.random_halls import random_hall

pytestmark = [pytest.mark.compiled]
promise = pytest.mark.promise("P8")


def few_or(few: int, many: int) -> pytest.MarkDecorator:
    """Repeat a test in `few` halls, and in `many` with `make soak`."""
    return pytest.mark.parametrize("halls", [few, pytest.param(many, marks=pytest.mark.soak)])


SETTINGS = load_settings("hallway")
RING = SETTINGS.ring
PERIOD_S = 0.05
MIRRORS, ROUGH = AcousticsConfig(model="specular"), AcousticsConfig(model="cone")
NOISY = AcousticsConfig(model="specular", noise_relative=0.01, dropout=0.05, outliers=0.03)
WILD = AcousticsConfig(outliers=0.2, noise_relative=0.01)
STRAYS = AcousticsConfig(model="cone", noise_relative=0.01, dropout=0.05, outliers=0.03)
FAULTY = math.nan

Path = Iterable[tuple[float, float, float]]
Found = dict[tuple[int, SensorFault], float]


def ring(
    preset: Preset | None = None, sets: tuple[tuple[int, ...], ...] | None = None, half_deg: float = 12.0
) -> RingConfig:
    firing = FiringConfig(preset=preset, sets=sets)
    return RING.model_copy(update={"firing": firing, "beam_half_angle_deg": half_deg})


def firings(
    config: RingConfig, world: WorldConfig, path: Path, lies: Mapping[int, float] | None = None, seed: int = 1
) -> Iterator[Firing]:
    """Yield the firings along a path, one for each pose; the sensors in `lies` always report that range."""
    sonar = Sonar(config, compile_scene(world), world.acoustics, np.random.default_rng(seed))
    masks = [sensors(mask) for mask in firing_pattern(config).masks]
    for k, ((x, y, yaw), fired) in enumerate(zip(path, itertools.cycle(masks), strict=False)):
        ranges = sonar.fire(Pose(x, y, yaw), yaw, fired)
        for sensor, lie in (lies or {}).items():
            if sensor in fired:
                ranges[sensor] = lie
        yield Firing(PERIOD_S * k, Pose(x, y, yaw), yaw, ranges)


def found(config: RingConfig, heard: Iterable[Firing]) -> Found:
    """Return every fault that was ever reported, with the distance driven until then, m."""
    watch, reports, way, last = SensorMonitor(config), dict[tuple[int, SensorFault], float](), 0.0, None
    for firing in heard:
        way += 0.0 if last is None else math.hypot(firing.pose.x - last.x, firing.pose.y - last.y)
        last = firing.pose
        watch.filter(firing)
        for report in watch.reports():
            reports.setdefault((report.sensor, report.fault), way)
    return reports


@promise
@few_or(1, 50)
def test_no_healthy_sensor_is_masked(halls: int, measured: Callable[[str], None]) -> None:
    """Random halls, specular and rough walls, with and without noise, on winding paths, the ring turning or not."""
    drives = 0
    presets: tuple[Preset, ...] = ("octets", "alternating", "single")
    for preset, acoustics in itertools.product(presets, (MIRRORS, ROUGH, NOISY, WILD)):
        for hall in range(halls):
            world, path = random_hall(hall, acoustics)
            swing = 0.3 * (hall % 2)
            turning = [(x, y, yaw + swing * math.sin(k / 200.0)) for k, (x, y, yaw) in enumerate(path)]
            config = ring(preset)
            assert found(config, firings(config, world, turning)) == {}, (preset, acoustics, hall)
            drives += 1
    measured(f"{drives} drives through random halls: 0 honest sensors masked")


@promise
@pytest.mark.parametrize(
    "acoustics", [*(pytest.param(one, marks=pytest.mark.soak) for one in (MIRRORS, ROUGH)), STRAYS]
)
def test_equal_readings_are_legitimate_if_nothing_should_change_them(
    acoustics: AcousticsConfig, measured: Callable[[str], None]
) -> None:
    """At rest before a wall, along one, between two, with slipping wheels, and at any angle."""
    for angle in np.radians(np.arange(0.0, 90.0, 30.0)).tolist():
        c, s = math.cos(angle), math.sin(angle)
        walls = tuple(
            WallConfig(x1_m=-50 * c - d * s, y1_m=-50 * s + d * c, x2_m=50 * c - d * s, y2_m=50 * s + d * c)
            for d in (1.5, -2.0)
        )
        world = WorldConfig(wall=walls, acoustics=acoustics)
        still = [(0.0, 0.0, 0.0)] * 600
        along = [(0.015 * k * c, 0.015 * k * s, 0.0) for k in range(1000)]
        config = ring("octets")
        assert found(config, firings(config, world, still)) == {}
        assert found(config, firings(config, world, along)) == {}
        slipping = (
            Firing(f.robot_s, Pose(x, y, 0.0), 0.0, f.ranges_m)
            for f, (x, y, _) in zip(firings(config, world, still), along, strict=False)
        )
        assert found(config, slipping) == {}, "the base slips, and no sensor is to blame"
    measured("at rest, along walls at 3 angles and with slipping wheels: 0 masked")


@promise
@few_or(6, 100)
def test_a_rough_wall_along_the_way_is_no_fault_of_the_sensors_that_look_along_it(
    halls: int, measured: Callable[[str], None]
) -> None:
    """Straight into the dead end of the shipped office: a sensor repeats its reading for metres, beside strays."""
    world = load_settings("office").world
    assert world is not None
    for k in range(halls):
        y = 3.4 + 0.5 * (k / halls - 0.5)
        into = [(3.2 + 0.015 * step, y, 0.0) for step in range(420)]
        assert found(RING, firings(RING, world, into, seed=k)) == {}, k
    measured(f"{halls} drives between rough walls: 0 honest sensors masked")


@promise
@few_or(1, 24)
def test_a_stuck_sensor_is_masked_and_reported(halls: int, measured: Callable[[str], None]) -> None:
    """Every sensor (of which the short form has each fourth), stuck near or in the middle; each in another hall."""
    ways: list[float] = []
    for hall, sensor in itertools.product(range(halls), range(0, 24, 4 if halls == 1 else 1)):
        stuck_m = (0.1524, 1.2)[(sensor + sensor // 2 + hall) % 2]
        world, path = random_hall(sensor + hall, NOISY)
        got = found(RING, firings(RING, world, path, {sensor: stuck_m}))
        assert set(got) == {(sensor, "stuck")}
        ways += got.values()
    measured(
        f"{len(ways)} drives, each with another sensor stuck: {len(ways)} masked, after {min(ways):.1f} to "
        f"{max(ways):.1f} m (median {np.median(ways):.1f})"
    )


@pytest.mark.boundscheck
def test_a_stuck_sensor_is_reported_with_its_range_and_gives_no_reading() -> None:
    watch = SensorMonitor(RING)
    world, path = random_hall(3, NOISY)
    for firing in firings(RING, world, path, {7: 1.2}):
        believed, possible = watch.filter(firing)
    assert np.isnan(believed.ranges_m[7])
    assert np.isnan(possible.ranges_m[7])
    (report,) = watch.reports()
    assert report.reason.startswith("sensor 7 always answers 1.20 m although the base has moved on: masked; ")


@promise
def test_a_failing_sensor_is_reported_but_not_one_outside_the_pattern(measured: Callable[[str], None]) -> None:
    world, path = random_hall(0, NOISY)
    for sensor in range(24):
        got = found(RING, firings(RING, world, path[: MISSED_FIRINGS_MAX + 1], {sensor: FAULTY}))
        assert set(got) == {(sensor, "failing")}
    sparse = ring(sets=(tuple(range(0, 24, 2)), tuple(range(0, 24, 3))))
    assert found(sparse, firings(sparse, world, path)) == {}
    watch = SensorMonitor(RING)
    for firing in firings(sparse, world, path):
        watch.filter(firing)
    assert {r.sensor for r in watch.reports()} == {1, 5, 7, 11, 13, 17, 19, 23}
    watch.set_firing_pattern(sparse)
    for firing in firings(RING, world, path[:6]):
        watch.filter(firing)
    assert watch.reports() == ()
    measured(f"24 sensors that always fail: 24 reported after {MISSED_FIRINGS_MAX} firings")


@promise
@few_or(6, 24)
def test_the_silence_of_a_silent_sensor_is_masked_until_its_first_echo(
    halls: int, measured: Callable[[str], None]
) -> None:
    """In halls of rough objects, where both neighbours hear echoes; each hall has another silent sensor."""
    caught = 0
    for hall in range(halls):
        sensor = hall * 24 // halls
        world, path = random_hall(sensor, ROUGH)
        got = found(RING, firings(RING, world, path, {sensor: math.inf}))
        assert set(got) <= {(sensor, "silent")}
        caught += len(got)
    assert caught >= 0.8 * halls, "in a few halls too few echoes are near"
    watch = SensorMonitor(RING)
    world, path = random_hall(0, ROUGH)
    drive = list(firings(RING, world, path, {0: math.inf}))
    for firing in drive:
        believed, _ = watch.filter(firing)
        if watch.reports() and not np.isnan(firing.ranges_m[0]):
            assert np.isnan(believed.ranges_m[0])
            break
    echo = Firing(
        firing.robot_s + 0.15, firing.pose, firing.ring_yaw, np.where(np.isnan(firing.ranges_m), np.nan, 2.0)
    )
    believed, _ = watch.filter(echo)
    assert believed.ranges_m[0] == 2.0
    assert watch.reports() == ()
    measured(f"{halls} sensors that never hear: the silence of {caught} not believed")


def test_a_sensor_that_another_test_found_stuck_is_masked_until_it_reads_otherwise() -> None:
    monitor, ranges = SensorMonitor(RING), np.full(24, math.inf)

    def trusted(range_m: float) -> float:
        ranges[3] = range_m
        return float(monitor.filter(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges))[0].ranges_m[3])

    assert trusted(2.0) == 2.0
    monitor.mask_stuck(3)
    assert math.isnan(trusted(2.0))
    (report,) = monitor.reports()
    assert (report.sensor, report.fault) == (3, "stuck")
    assert "always answers 2.00 m" in report.reason
    assert [trusted(3.0) for _ in range(RECOVERY_READINGS)][-1] == 3.0
    assert monitor.reports() == ()


def test_a_stuck_sensor_returns_to_use_when_it_behaves() -> None:
    world, path = random_hall(3, NOISY)
    watch, config = SensorMonitor(RING), RING
    for firing in firings(config, world, path, {7: 1.2}):
        watch.filter(firing)
    assert watch.reports()
    masked = 0
    for firing in firings(config, world, path[-200:]):
        believed, _ = watch.filter(firing)
        masked += bool(np.isnan(believed.ranges_m[7]) and not np.isnan(firing.ranges_m[7]))
    assert watch.reports() == ()
    assert masked <= 3 * RECOVERY_READINGS


def crosstalk(config: RingConfig, halls: int) -> tuple[int, int, int, int]:
    """Return counts: crosstalk readings, trusted ones of these, true readings, untrusted ones of those."""
    heard = through = honest = lost = 0
    for hall in range(halls):
        world, path = random_hall(hall, MIRRORS)
        loud = world.model_copy(update={"acoustics": MIRRORS.model_copy(update={"crosstalk": 1.0})})
        watch = SensorMonitor(config)
        for firing, true in zip(firings(config, loud, path), firings(config, world, path), strict=True):
            fired = ~np.isnan(firing.ranges_m)
            ghosts = fired & (firing.ranges_m < np.nan_to_num(true.ranges_m, nan=0.0) - 0.1)
            doubted = np.isnan(watch.filter(firing)[0].ranges_m)
            heard += int(ghosts.sum())
            through += int((ghosts & ~doubted).sum())
            honest += int((fired & ~ghosts).sum())
            lost += int((fired & ~ghosts & doubted).sum())
    return heard, through, honest, lost


THREE = tuple(tuple(range(k, 24, 3)) for k in range(3))
TWO = tuple(tuple(range(k, 24, 2)) for k in range(2))


@promise
@few_or(1, 24)
def test_octets_of_the_ring_s_own_beam_hear_no_partner(halls: int, measured: Callable[[str], None]) -> None:
    heard, _, honest, _ = crosstalk(ring("octets"), halls)
    assert heard == 0
    measured(f"octets, beams of ±12°: 0 of {honest} readings are crosstalk, by geometry")


@promise
@few_or(1, 24)
@pytest.mark.parametrize(
    ("name", "config", "share"),
    [
        ("alternating, beams of ±20°", ring("alternating", half_deg=20.0), 0.25),
        ("every second sensor and octets in turn", ring(sets=(*TWO, *THREE)), 0.08),
    ],
)
def test_another_firing_partner_exposes_crosstalk(
    name: str, config: RingConfig, share: float, halls: int, measured: Callable[[str], None]
) -> None:
    heard, through, honest, lost = crosstalk(config, halls)
    assert heard > 50 * halls
    assert through < share * heard
    assert lost < 0.06 * honest
    measured(
        f"{name}: of {heard} crosstalk readings {through} believed; {lost} of {honest} others doubted for a firing"
    )


@promise
def test_persistent_crosstalk_is_masked_and_names_the_partners() -> None:
    """Two sensors of one set, one of which reads short in it; in the other set it does not."""
    config = ring(sets=((0, 2), (0, 12)))
    watch = SensorMonitor(config)
    seen = []
    for k in range(120):
        ranges = np.full(24, np.nan)
        ranges[[0, 2] if k % 2 == 0 else [0, 12]] = 4.0
        if k % 2 == 0:
            ranges[0] = 1.0
        believed, possible = watch.filter(Firing(PERIOD_S * k, Pose(0.0, 0.0, 0.0), 0.0, ranges))
        seen.append((believed.ranges_m[0], possible.ranges_m[0]))
    assert [b for b, _ in seen[1::2]] == [4.0] * 60
    assert np.isnan([b for b, _ in seen[40::2]]).all()
    assert seen[40][1] == 1.0, "in doubt: kept clear of"
    assert math.isnan(seen[100][1]), "masked in that set"
    (report,) = watch.reports()
    assert report.reason.startswith("sensor 0 reads short when it fires together with 2 and not otherwise: ")


def test_sets_without_a_pattern_are_not_compared() -> None:
    """For example a log that lists only the sensors with new readings."""
    watch, rng = SensorMonitor(RING), np.random.default_rng(5)
    for k in range(400):
        ranges = np.where(rng.random(24) < 0.5, rng.uniform(0.5, 7.0, 24), np.nan)
        firing = Firing(PERIOD_S * k, Pose(0.0, 0.0, 0.0), 0.0, ranges)
        assert watch.filter(firing) == (firing, firing)


def test_masks_apply_to_map_and_obstacles_and_are_part_of_the_snapshot() -> None:
    perception = Perception(RING, SETTINGS.models, SETTINGS.perception)
    world, path = random_hall(3, NOISY)
    drive = list(firings(RING, world, path, {7: 1.2}))
    for firing in drive:
        perception.observe(firing)
    (report,) = perception.sensor_reports()
    assert report.sensor == 7
    last = drive[-1]
    points = perception.obstacles(last.robot_s, 1.0)
    away = np.hypot(points[:, 0] - last.pose.x, points[:, 1] - last.pose.y)
    assert not np.isclose(away, 1.2 + 0.381, atol=0.001).any()
    other = Perception(RING, SETTINGS.models, SETTINGS.perception)
    other.restore(perception.snapshot())
    assert other.sensor_reports() == perception.sensor_reports()
    other.reset()
    assert other.sensor_reports() == perception.sensor_reports(), "the robot restarted, the sensor is still broken"


def test_cross_paths_of_a_faulty_sensor_are_left_out_whichever_end_it_is_at() -> None:
    monitor, count = SensorMonitor(RING), len(RING.mounts)
    heard = CrossPaths(np.array([0, 0, 5]), np.array([1, 2, 6]), np.array([1.0, 1.1, 1.2]))
    for k in range(MISSED_FIRINGS_MAX + 2):
        ranges = np.full(count, 2.0)
        ranges[2] = FAULTY
        trusted, _ = monitor.filter(Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.0), 0.0, ranges, heard))
        if k == 0:
            assert trusted.cross_paths is heard
    assert trusted.cross_paths is not None
    assert trusted.cross_paths.listeners.tolist() == [1, 6]
    assert trusted.cross_paths.half_paths_m.tolist() == [1.0, 1.2]
