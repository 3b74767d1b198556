"""What a robot lacks is named, with what follows from it."""

from __future__ import annotations

import pytest

from config.load import load_robot
from drivers.capabilities import CAPABILITIES, missing
from drivers.registry import capabilities


def test_what_is_missing_has_a_reason_and_what_is_unknown_is_refused() -> None:
    assert missing(CAPABILITIES) == {}
    lacks = missing(set(CAPABILITIES) - {"deadman"})
    assert "kill -9" in lacks["deadman"]
    with pytest.raises(ValueError, match="no capability: wings; there are deadman"):
        missing({"wings"})


@pytest.mark.parametrize("name", ["denning", "p3dx", "b21r"])
def test_the_shipped_robots_can_do_all(name: str) -> None:
    assert missing(capabilities(load_robot(name))) == {}
