"""Recordings of real robots, kept in tests/data as ring logs with the robot's file beside each."""

from __future__ import annotations

from pathlib import Path

from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing
from runtime.recording.ring_log import read_ring_log

DATA = Path(__file__).parent / "data"


def recording(name: str) -> tuple[Settings, list[Firing]]:
    """Return the settings of the robot that made a recording, and its firings; see data/README.md."""
    settings = load_settings(robot=str(DATA / f"{name}.toml"))
    return settings, list(read_ring_log(DATA / f"{name}.csv", len(settings.ring.mounts)))
