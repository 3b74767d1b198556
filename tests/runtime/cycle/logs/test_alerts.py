"""Tests of the alerts: one line for each new fact, none for what was reported."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

from drivers.driver import Received
from drivers.messages import Flags, Pose
from perception.detected_object import MapCounts
from perception.localization.submaps.echo_lag import FoundLag
from perception.sensor_faults.report import SensorReport
from runtime.cycle.echo_watch import OPEN_M, EchoWatch
from runtime.cycle.logs.alerts import BATTERY, LINES_BURST, LINES_PER_S, Alerts

NOTHING = Received((), None, rebooted=False)


class StubPerception:
    """Perception, reduced to its reports about sensors."""

    def __init__(self) -> None:
        self.sensor_monitor = SimpleNamespace(changes=0)
        self.reports: list[SensorReport] = []
        self.counts = MapCounts(0, 0, 0)
        self.known_room: SimpleNamespace | None = None
        self.echo_lag: SimpleNamespace | None = None

    def report(self, *reports: SensorReport) -> None:
        self.reports = list(reports)
        self.sensor_monitor.changes += 1

    def sensor_reports(self) -> list[SensorReport]:
        assert self.sensor_monitor.changes, "asked only after a change"
        return self.reports


def report(sensor: int, fault: str) -> SensorReport:
    return SensorReport(sensor=sensor, fault=fault, reason=f"sensor {sensor} is {fault}")  # type: ignore[arg-type]


def state(
    perception: StubPerception, ring_problem: str | None = None, reason: str | None = None, way_m: float = 0.0
) -> Any:
    watch, mode = EchoWatch(is_over=True, way_m=way_m), SimpleNamespace(reason=reason)
    return SimpleNamespace(perception=perception, ring_problem=ring_problem, mode=mode, echo_watch=watch)


def test_a_long_silence_is_a_line_once_until_the_ring_hears_again() -> None:
    alerts, perception = Alerts(), StubPerception()
    lines = [alerts.update(NOTHING, state(perception, way_m=way_m), 0.0) for way_m in (0.0, OPEN_M, OPEN_M)]
    assert [len(line) for line in lines] == [0, 1, 0]
    assert lines[1][0].startswith("no sensor has heard anything new over the last 4 m")
    assert alerts.update(NOTHING, state(perception), 0.0) == []
    assert alerts.recovered == ["the ring hears echoes again"]


def test_a_low_battery_is_a_line_now_and_then() -> None:
    alerts, perception = Alerts(), StubPerception()
    low = Received((), None, rebooted=False, flags=Flags.BATTERY_LOW)
    moments = [alerts.update(low, state(perception), float(run_s)) for run_s in range(1500)]
    assert [run_s for run_s, lines in enumerate(moments) if lines == [BATTERY]] == [0, 600, 1200]


def test_each_fact_is_reported_once() -> None:
    alerts, perception = Alerts(), StubPerception()
    seen = state(perception)
    assert alerts.update(NOTHING, seen, 0.0) == []
    perception.report(report(7, "failing"))
    assert alerts.update(NOTHING, seen, 0.0) == ["sensor 7 is failing"]
    assert alerts.update(NOTHING, seen, 0.0) == []
    perception.report(report(7, "failing"), report(5, "stuck"))
    assert alerts.update(NOTHING, seen, 0.0) == ["sensor 5 is stuck"]
    perception.report(report(5, "crosstalk"))
    assert alerts.update(NOTHING, seen, 0.0) == ["sensor 5 is crosstalk"]
    assert alerts.recovered == ["sensor 7 works again and is used"], "no warning"
    perception.report(report(5, "crosstalk"), report(7, "failing"))
    assert alerts.update(NOTHING, seen, 0.0) == ["sensor 7 is failing"], "a fault that returned is a new fact"


def test_objects_without_room_are_reported_once() -> None:
    alerts, perception = Alerts(), StubPerception()
    seen = state(perception)
    perception.counts = MapCounts(9, 9, 9, archived=70, waiting=4)
    (line,) = alerts.update(NOTHING, seen, 0.0)
    assert line.startswith("4 objects near the robot have no room")
    perception.counts = MapCounts(9, 9, 9, archived=70, waiting=6)
    assert alerts.update(NOTHING, seen, 0.1) == []
    perception.counts = MapCounts(9, 9, 9, archived=70, waiting=0)
    assert alerts.update(NOTHING, seen, 0.2) == []
    perception.counts = MapCounts(9, 9, 9, archived=70, waiting=1)
    assert len(alerts.update(NOTHING, seen, 0.3)) == 1, "again, after all had found room"


def test_the_figures_in_a_report_may_change() -> None:
    alerts, perception = Alerts(), StubPerception()
    for looks in (12, 13):
        perception.report(SensorReport(3, "silent", f"sensor 3 has heard nothing in {looks} looks"))
        lines = alerts.update(NOTHING, state(perception), 0.0)
        assert lines == (["sensor 3 has heard nothing in 12 looks"] if looks == 12 else [])


def test_a_problem_of_the_ring_that_stops_no_drive_is_a_line() -> None:
    """While the robot is pushed, say; what stops a drive is the reason of that stop."""
    alerts, perception, why = Alerts(), StubPerception(), "the ring repeats old readings"
    assert alerts.update(NOTHING, state(perception, why, reason=why), 0.0) == []
    lines = alerts.update(NOTHING, state(perception, why, reason="not armed"), 1.0)
    assert lines == [f"while the robot does not drive: {why}"]
    assert alerts.update(NOTHING, state(perception, why, reason="not armed"), 2.0) == []
    assert alerts.update(NOTHING, state(perception), 3.0) == []


def test_notes_of_the_driver_are_passed_on() -> None:
    perception = StubPerception()
    received = Received((), None, rebooted=False, notes=("the odometry jumped by 0.30 m",))
    assert Alerts().update(received, state(perception), 0.0) == ["the odometry jumped by 0.30 m"]


def test_a_robot_that_causes_line_after_line_has_the_excess_counted() -> None:
    alerts, perception = Alerts(), StubPerception()
    received = Received((), None, rebooted=False, notes=("it jumped",) * 16)
    seen = state(perception)
    lines = [line for k in range(2000) for line in alerts.update(received, seen, 0.05 * k)]
    assert len(lines) <= LINES_BURST + LINES_PER_S * 100.0
    left_out = sum(
        int(re.findall(r"\((\d+) such lines were left out before\)", line)[0]) for line in lines if "(" in line
    )
    assert 0 <= 16 * 2000 - len(lines) - left_out < 16 * 20, "all but those since the last line are counted"


def test_what_is_new_of_the_place_in_a_known_room_is_reported_once() -> None:
    alerts, perception = Alerts(), StubPerception()
    seen = state(perception)
    here = SimpleNamespace(pose=Pose(1.0, 2.0, 0.0))
    perception.known_room = SimpleNamespace(status="localizing", refuted=0, rivals=0, localized=lambda: here)
    assert alerts.update(NOTHING, seen, 0.0) == []
    for change, said in (
        ({"status": "tracking"}, "the robot's place is known: (1.00 m, 2.00 m) in the map"),
        ({"status": "lost"}, "the robot's place is lost"),
        ({"status": "localizing", "rivals": 2}, "the readings fit 3 places of this room alike"),
        ({"rivals": 1}, None),
        ({"status": "lost", "refuted": 1, "rivals": 0}, "the readings do not fit the place that was named"),
    ):
        vars(perception.known_room).update(change)
        lines = alerts.update(NOTHING, seen, 1.0)
        assert (len(lines) == 0) == (said is None or "known" in said), "what is well again is no warning"
        lines += alerts.recovered
        assert len(lines) == (said is not None)
        assert not lines or lines[0].startswith(said or "")
        assert alerts.update(NOTHING, seen, 1.0) == []


def test_a_lag_of_the_ranges_is_told_once_with_what_to_set() -> None:
    alerts, perception = Alerts(), StubPerception()
    lag = SimpleNamespace(lag_s=0.0, given_s=0.0, found=lambda: FoundLag(0.163, 0.02, 9.0))
    perception.echo_lag = lag
    assert alerts.update(NOTHING, state(perception), 0.0) == []
    lag.lag_s = 0.163
    (line,) = alerts.update(NOTHING, state(perception), 1.0)
    assert line.startswith("the ranges lag behind odometry by 0.16 s (± 0.02)")
    assert "echo_lag_s = 0.16" in line
    assert alerts.update(NOTHING, state(perception), 2.0) == []
