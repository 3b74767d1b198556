"""A polyline, and perception that reports it."""

from __future__ import annotations

import numpy as np
import pytest

from perception.pipeline import Perception
from perception.polyline import Polyline

BEND = Polyline(3, np.array([[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]]), 0.9)
"""Two pieces of 1 m."""


def report_bend(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let perception report this polyline, whatever it hears."""
    reported = (BEND,)
    monkeypatch.setattr(Perception, "polylines", lambda _: reported)
