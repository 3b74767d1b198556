"""The hallway of six drums with an emulated Pioneer 3-DX: sixteen uneven sensors and partial lists of ranges."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from config.load import load_settings
from runtime.cycle.modes import Mode
from runtime.simulation.closed_loop import simulate
from runtime.simulation.evaluation import estimates, match_drums

FOOT_M = 0.3048
ONE_WAY_S = 15.0


@pytest.mark.compiled
@pytest.mark.promise("P29")
def test_six_drums_are_found_in_one_way_down_the_hall(measured: Callable[[str], None]) -> None:
    settings = load_settings("hallway", ["world.acoustics.model=specular"], robot="p3dx")
    assert settings.world is not None
    run = simulate(settings, settings.world, 1, ONE_WAY_S)
    rows, false = match_drums(settings.world, estimates(run))
    errors_ft = [row["error"] / FOOT_M for row in rows if row["error"] is not None]
    assert run.state.mode.mode is Mode.DRIVE
    assert run.truth.contacts == 0
    assert (len(errors_ft), false) == (6, 0)
    assert max(errors_ft) <= 0.02
    assert run.counts.bad == 0
    measured(f"p3dx, {ONE_WAY_S:g} s: 6 of 6 drums, 0 false, error ≤ {max(errors_ft):.3f} ft")
