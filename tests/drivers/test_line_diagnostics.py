"""Messages that every family shares: when there is one, and what it says."""

from __future__ import annotations

import pytest

from config.robot import LinkConfig
from drivers.line_diagnostics import deadman_refused, noise, silence


@pytest.mark.parametrize("deadman_s", [0.0, 0.05, 2.0])
def test_a_deadman_outside_the_robot_files_limits_is_refused(deadman_s: float) -> None:
    message = deadman_refused("box", deadman_s, LinkConfig())
    assert message is not None
    assert f"'box' stops by itself {deadman_s:g} s after" in message
    assert "allows 0.1 to 1 s" in message


@pytest.mark.parametrize("deadman_s", [0.1, 0.5, 1.0])
def test_a_deadman_within_the_limits_is_accepted(deadman_s: float) -> None:
    assert deadman_refused("box", deadman_s, LinkConfig()) is None


def test_few_corrupt_frames_are_no_noise() -> None:
    assert noise(2, "it") is None
    assert "3 corrupt frames came in place of it" in (noise(3, "it") or "")


def test_silence_names_its_likely_cause() -> None:
    assert "noise on the line" in silence(0.5, others=False, bad=3)
    assert "its base has stopped working" in silence(0.5, others=True, bad=0)
    assert "nothing received for 0.50 s" in silence(0.5, others=False, bad=0)
