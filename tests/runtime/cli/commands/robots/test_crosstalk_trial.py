"""Neighbours that fire together and hear each other are named, with what to do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.errors import FAILED, NOT_SHOWN
from config.load import load_settings
from config.robot import RingConfig
from drivers.registry import make_device
from runtime.cli.commands.robots import ring_trial
from runtime.cli.commands.robots.crosstalk_trial import crosstalk
from runtime.cli.commands.robots.ring_trial import RingTest, with_single_firing
from tests.runtime.cli.commands.robots.test_hand_trial import FRONT3
from tests.runtime.virtual_time import MemoryLink, VirtualLoop

TOGETHER = RingConfig.model_validate(FRONT3.model_dump() | {"firing": {"sets": [[0, 1, 2]]}})


def test_ranges_that_are_shorter_only_together_are_crosstalk() -> None:
    alone = [[1.0, 1.01, math.inf], [2.0] * 5, [math.inf] * 5]
    assert crosstalk(alone, alone, TOGETHER) == {}
    found = crosstalk(alone, [[1.0] * 5, [2.0, 2.0, 1.2, 1.2], [0.9, math.inf, 0.9]], TOGETHER)
    assert sorted(found) == [1, 2]
    assert (
        "together with 0, 2 and then hears 1.20 m in 2 of 4 firings, by itself nothing nearer than 2.00" in found[1]
    )
    assert "by itself nothing: fire sensors" in found[2]


@pytest.mark.parametrize("rounds", [1, 2, 3, 10, 20])
def test_unsteady_echoes_are_not_taken_for_those_of_others(rounds: int) -> None:
    """Two trials of them differ by chance; what is shorter in most firings is named all the same."""
    rng = np.random.default_rng(rounds)
    named = 0
    for _ in range(200):
        ranges = rng.uniform(0.1, 3.5, (2, 3, rounds))
        named += len(crosstalk(ranges[0].tolist(), ranges[1].tolist(), TOGETHER))
    assert named <= 12, "of 600, by chance"
    if rounds >= 10:
        alone = rng.uniform(1.0, 3.5, (3, rounds)).tolist()
        assert sorted(crosstalk(alone, [alone[0], [0.5] * rounds, alone[2]], TOGETHER)) == [1]


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_neighbours_that_fire_together_are_found(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, said = VirtualLoop(), list[str]()
    config = load_settings("room", ("link.port=memory",), robot="servo1").model_copy(update={"ring": TOGETHER})
    assert config.world is not None
    acoustics = config.world.acoustics.model_copy(update={"crosstalk": share})
    world = config.world.model_copy(
        update={"acoustics": acoustics, "start": config.world.start.model_copy(update={"heading_deg": 35.0})}
    )
    device = make_device(config, world, 3)
    monkeypatch.setattr(ring_trial, "Link", lambda *args, **_options: MemoryLink(device, loop, *args))
    try:
        trial = RingTest(with_single_firing(config), said.append, loop.time, TOGETHER)
        assert loop.run_until_complete(trial.run(10, move=False)) == (FAILED if share else NOT_SHOWN), said
    finally:
        loop.close()
    assert any("CROSSTALK: it fires together with" in line for line in said) is (share > 0.0)
