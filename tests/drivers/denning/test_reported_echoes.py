"""What the emulated ring reports of a firing, in both versions, with faults of its sensors."""

from __future__ import annotations

from typing import Any

import numpy as np

from config.robot import RingConfig
from config.world import AcousticsConfig, WorldConfig
from drivers.denning.frames import Echo, Echo2
from drivers.denning.pattern_rotation import Step
from drivers.denning.reported_echoes import EchoReporter
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import Fault
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose
from tests.drivers.device_host import script
from tests.drivers.emulator.one_sensor import wall

RING = RingConfig(
    count=4, radius_m=0.1, beam_half_angle_deg=12.0, resolution_m=0.002, range_min_m=0.02, range_max_m=5.0
)
STEP = Step(at_us=0, number=3, mask=0b101, listeners=0b10, window_m=4.0, closes_us=23_000)
HERE = Pose(0.0, 0.0, 0.0)


def reporter(*faults: Fault) -> EchoReporter:
    scene = compile_scene(WorldConfig(wall=(wall(2.0, -9.0, 2.0, 9.0),)))
    schedule = FaultSchedule(faults)
    for begins, fault in schedule.due(0):
        schedule.set_active(fault, on=begins)
    sonar = Sonar(RING, scene, AcousticsConfig(), np.random.default_rng(1))
    return EchoReporter(RING, sonar, schedule, np.random.default_rng(2))


def broken(**fault: Any) -> Fault:
    (one,) = script(at_s=0.0, duration_s=9.0, **fault)
    return one


def test_a_firing_in_both_versions() -> None:
    ring = reporter()
    assert ring.unit_um == 2000
    assert ring.fire(STEP, 7, HERE, 0.0, 1) == Echo(0, 7, 3, 0b101, (62, 255))
    assert ring.fire(STEP, 7, HERE, 0.0, 2) == Echo2(0, 7, 3, 0b101, 0b10, (950, 65535, 65535))


def test_a_stuck_sensor_and_one_that_reports_its_fault() -> None:
    ring = reporter(broken(kind="stuck_sensor", sensor=0, range_m=1.0), broken(kind="stuck_sensor", sensor=1))
    echo = ring.fire(STEP, 7, HERE, 0.0, 2)
    assert isinstance(echo, Echo2)
    assert echo.counts == (500, 65535, 0)


def test_outliers_lie_inside_the_window() -> None:
    ring = reporter(broken(kind="outliers", share=1.0))
    echo = ring.fire(STEP, 7, HERE, 0.0, 2)
    assert isinstance(echo, Echo2)
    assert all(1 <= count <= 2000 for count in echo.counts)
