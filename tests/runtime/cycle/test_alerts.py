"""Tests of the alerts: one line for each new fact, none for what was reported."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from drivers.driver import Received
from perception.sensor_report import SensorReport
from runtime.cycle.alerts import Alerts

NOTHING = Received((), None, rebooted=False)


class StubPerception:
    """Perception, reduced to its reports about sensors."""

    def __init__(self) -> None:
        self.sensor_monitor = SimpleNamespace(changes=0)
        self.reports: list[SensorReport] = []

    def report(self, *reports: SensorReport) -> None:
        self.reports = list(reports)
        self.sensor_monitor.changes += 1

    def sensor_reports(self) -> list[SensorReport]:
        assert self.sensor_monitor.changes, "asked only after a change"
        return self.reports


def report(sensor: int, fault: str) -> SensorReport:
    return SensorReport(sensor=sensor, fault=fault, reason=f"sensor {sensor} is {fault}")  # type: ignore[arg-type]


def test_each_fact_is_reported_once() -> None:
    alerts, perception = Alerts(), StubPerception()
    seen: Any = perception
    assert alerts.update(NOTHING, seen) == []
    perception.report(report(7, "failing"))
    assert alerts.update(NOTHING, seen) == ["sensor 7 is failing"]
    assert alerts.update(NOTHING, seen) == []
    perception.report(report(7, "failing"), report(5, "stuck"))
    assert alerts.update(NOTHING, seen) == ["sensor 5 is stuck"]
    perception.report(report(5, "crosstalk"))
    assert alerts.update(NOTHING, seen) == ["sensor 5 is crosstalk", "sensor 7 works again and is used"]
    perception.report(report(5, "crosstalk"), report(7, "failing"))
    assert alerts.update(NOTHING, seen) == ["sensor 7 is failing"], "a fault that returned is a new fact"


def test_notes_of_the_driver_are_passed_on() -> None:
    perception: Any = StubPerception()
    received = Received((), None, rebooted=False, notes=("the odometry jumped by 0.30 m",))
    assert Alerts().update(received, perception) == ["the odometry jumped by 0.30 m"]
