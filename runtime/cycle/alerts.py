"""Alerts to the operator about sensors and odometry while the robot drives; each is sent once."""

from __future__ import annotations

from drivers.driver import Received
from perception.pipeline import Perception
from perception.sensor_report import SensorReport


class Alerts:
    """Detects new facts from cycle to cycle."""

    def __init__(self) -> None:
        self._changes = 0
        self._reported: dict[int, SensorReport] = {}

    def update(self, received: Received, perception: Perception) -> list[str]:
        """Return a line for each new fact: what happened, likely cause, next action."""
        lines = list(received.notes)
        if perception.sensor_monitor.changes == self._changes:
            return lines
        self._changes = perception.sensor_monitor.changes
        now = {report.sensor: report for report in perception.sensor_reports()}
        lines += [report.reason for sensor, report in now.items() if self._reported.get(sensor) != report]
        lines += [f"sensor {sensor} works again and is used" for sensor in self._reported if sensor not in now]
        self._reported = now
        return lines
