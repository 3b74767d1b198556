"""Robots with blind sides: each can drive, and none touches a mirror that it could not hear."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bench.lies import honest, measure
from bench.sparse_rings import RADIUS_M, RINGS
from bench.trials.room_drives import make_drive
from runtime.support.blind_sides import blind_sides_deg
from runtime.support.pattern_check import pattern_speed_m_s, refuse_undrivable


@pytest.mark.parametrize("name", RINGS)
def test_each_ring_but_one_is_blind_somewhere_and_each_but_one_drives(name: str) -> None:
    settings = make_drive(name, "furnished", 1).settings
    assert settings.body.radius_m == RADIUS_M
    assert len(settings.ring.mounts) == len(RINGS[name])
    assert bool(blind_sides_deg(settings)) == (name != "round-12")
    refuse_undrivable(settings)
    assert (pattern_speed_m_s(settings) > 0.0) == (name != "front-1")


@pytest.mark.soak
@pytest.mark.compiled
def test_four_sensors_in_front_touch_nothing_in_twenty_rooms(measured: Callable[[str], None]) -> None:
    results = measure(honest(("front-4",), ("furnished",), range(300, 320), 1), lambda _: None)
    assert [one for one in results if one.is_contact] == []
    measured(f"{len(results)} wanders of 120 s, {sum(one.way_m for one in results):.0f} m: no contact")
