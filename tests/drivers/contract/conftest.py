"""Every test of the contract runs once for each family."""

from __future__ import annotations

import pytest

from tests.drivers.contract.families import FAMILIES, Family


@pytest.fixture(params=sorted(FAMILIES))
def family(request: pytest.FixtureRequest) -> Family:
    return FAMILIES[request.param]
