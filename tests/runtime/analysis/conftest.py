"""The timeline of the recorded run, loaded once for all tests of the analysis."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.analysis.timeline import Timeline
from runtime.analysis.timeline_sources import TimelineSource, load_timeline


@pytest.fixture(scope="session")
def timeline(hall_run: Path) -> Timeline:
    return load_timeline(TimelineSource(str(hall_run)), lambda _settings: None)
