"""What a robot lacks is named, with what follows from it."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.robot import BodyConfig
from drivers.capabilities import CAPABILITIES, after_kill, missing, moves_on
from drivers.registry import capabilities, deadman_s


def test_what_is_missing_has_a_reason_and_what_is_unknown_is_refused() -> None:
    assert missing(CAPABILITIES) == {}
    lacks = missing(set(CAPABILITIES) - {"deadman"})
    assert "kill -9" in lacks["deadman"]
    with pytest.raises(ValueError, match="no capability: wings; there are deadman"):
        missing({"wings"})


@pytest.mark.parametrize("name", ["denning", "p3dx", "b21r"])
def test_the_shipped_robots_can_do_all(name: str) -> None:
    assert missing(capabilities(load_robot(name))) == {}


def test_how_long_a_killed_program_leaves_a_base_moving_follows_from_its_file() -> None:
    """From 0.5 m/s at 0.25 m/s²: 2 s and 0.5 m of braking after the deadman."""
    body = BodyConfig(radius_m=0.2, speed_max_m_s=0.5, turn_max_rad_s=1.0, acceleration_max_m_s2=0.25)
    found = moves_on(body, 0.6)
    assert found is not None
    assert (found.lasts_s, found.way_m) == pytest.approx((2.6, 0.8))
    assert after_kill(body, 0.6).startswith("kill -9 leaves it moving for at most 2.60 s and 0.80 m, from 0.5 m/s: ")
    assert "until it is switched off" in after_kill(body, None)


def test_the_deadman_is_that_of_the_file_or_the_longest_that_it_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    b21r, p3dx = load_robot("b21r"), load_robot("p3dx")
    assert deadman_s(b21r) == b21r.rflex.fail_safe_s
    assert deadman_s(p3dx) == p3dx.link.deadman_max_s == 2.0
    monkeypatch.setattr("drivers.registry.capabilities", lambda _config: frozenset({"latch"}))
    assert deadman_s(p3dx) is None
