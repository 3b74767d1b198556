"""What an operator should hear of sensors and odometry while the robot drives, each thing once."""

from __future__ import annotations

from drivers.driver import Received
from perception.pipeline import Perception
from perception.sensor_report import SensorReport


class Alerts:
    """Says what is new from cycle to cycle."""

    def __init__(self) -> None:
        self._changes = 0
        self._told: dict[int, SensorReport] = {}

    def news(self, heard: Received, perception: Perception) -> list[str]:
        """Return a line for each thing that is new: what happened, likely cause, next action."""
        lines = list(heard.notes)
        if perception.sensor_monitor.changes == self._changes:
            return lines
        self._changes = perception.sensor_monitor.changes
        now = {report.sensor: report for report in perception.sensor_reports()}
        lines += [report.reason for sensor, report in now.items() if self._told.get(sensor) != report]
        lines += [f"sensor {sensor} behaves again and is believed" for sensor in self._told if sensor not in now]
        self._told = now
        return lines
