"""The load of the line: what a robot sends, counted, and lines that are too slow for it refused."""

from __future__ import annotations

import re

import pytest

from config.load import load_settings
from config.robot import LinkConfig
from drivers.denning.line_load import ODOMETRY_PERIOD_S, refuse_overload, sent_bytes_s
from drivers.denning.wire_units import wire_pattern
from drivers.firing_pattern import FiringError
from drivers.line_budget import BAUDS, SHARE_MAX

PATTERN = wire_pattern(load_settings("hallway").ring)


def two_others(mask: int) -> int:
    """Return the mask of the first two sensors that are not in a mask."""
    first, second = [i for i in range(24) if not mask >> i & 1][:2]
    return 1 << first | 1 << second


@pytest.mark.parametrize(("version", "echo_bytes"), [(1, 14.0 + 8.0), (2, 17.0 + 16.0)])
def test_the_load_is_that_of_the_frames(version: int, echo_bytes: float) -> None:
    """A firing of eight sensors takes a byte or two of each beside its head, a sample of odometry 32."""
    alone = sent_bytes_s(PATTERN._replace(step_period_ms=10**9), (), version)
    assert alone * ODOMETRY_PERIOD_S == pytest.approx(32.0, abs=1.0)
    echo = (sent_bytes_s(PATTERN, (), version) - alone) * 1e-3 * PATTERN.step_period_ms
    assert echo == pytest.approx(echo_bytes, abs=1.0)
    heard = sent_bytes_s(PATTERN, tuple(map(two_others, PATTERN.masks)), version) - sent_bytes_s(PATTERN, (), version)
    two = 0.0 if version == 1 else 4.0
    assert heard * 1e-3 * PATTERN.step_period_ms == pytest.approx(two, abs=1.0), "two that listen"


def test_a_line_too_slow_for_its_traffic_is_refused_with_what_suffices() -> None:
    refuse_overload(LinkConfig(baud=115200), PATTERN, (), 2)
    refuse_overload(LinkConfig(baud=9600, port="socket://host:1"), PATTERN, (), 2)
    with pytest.raises(FiringError, match=r"set link\.baud to [0-9]+ or more") as refused:
        refuse_overload(LinkConfig(baud=9600), PATTERN, (), 2)
    enough = int(re.findall(r"link.baud to ([0-9]+)", str(refused.value))[0])
    refuse_overload(LinkConfig(baud=enough), PATTERN, (), 2)
    assert sent_bytes_s(PATTERN, (), 2) > SHARE_MAX * 0.1 * BAUDS[BAUDS.index(enough) - 1]


def test_a_longer_step_is_offered_where_it_suffices() -> None:
    fast = PATTERN._replace(step_period_ms=10)
    with pytest.raises(FiringError, match="step_period_s to") as refused:
        refuse_overload(LinkConfig(baud=28800), fast, (), 2)
    least_ms = round(1e3 * float(re.findall(r"step_period_s to ([0-9.]+)", str(refused.value))[0]))
    refuse_overload(LinkConfig(baud=28800), fast._replace(step_period_ms=least_ms), (), 2)
    with pytest.raises(FiringError):
        refuse_overload(LinkConfig(baud=28800), fast._replace(step_period_ms=least_ms - 1), (), 2)
