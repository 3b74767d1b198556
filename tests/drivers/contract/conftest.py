"""Every test of the contract runs once for each family."""

from __future__ import annotations

import pytest

from drivers import registry
from drivers.contract.family import Family
from drivers.registry import GROUP
from tests.drivers.contract.families import CHIRP_ENTRY, FAMILIES


@pytest.fixture(autouse=True)
def _installed_example(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the example known as if an installed package provided it."""
    monkeypatch.setattr(registry, "plugged", lambda group: {CHIRP_ENTRY.name: CHIRP_ENTRY} if group == GROUP else {})


EACH = [pytest.param(name, marks=[pytest.mark.soak] if name == "servo1" else []) for name in sorted(FAMILIES)]
"""The robot with a servo has the driver of `denning`, and its own tests."""


@pytest.fixture(params=EACH)
def family(request: pytest.FixtureRequest) -> Family:
    return FAMILIES[request.param]
