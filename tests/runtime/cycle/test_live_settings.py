"""The store of live settings: changes as a whole, undo, and notification."""

from __future__ import annotations

import pytest

from config.load import ConfigError, load_settings
from config.settings import Settings
from runtime.cycle.live_settings import UNDO_MAX, LiveSettings

START = load_settings("hallway")


def with_velocity(velocity_m_s: float) -> Settings:
    return load_settings("hallway", [f"behaviors.arbiter.base_velocity_m_s={velocity_m_s}"])


SLOW, FAST = with_velocity(0.2), with_velocity(0.4)


def velocity(live: LiveSettings) -> float:
    return live.current.behaviors.arbiter.base_velocity_m_s


def test_a_change_is_put_in_force_and_subscribers_are_notified() -> None:
    live, notified = LiveSettings(START), list[Settings]()
    live.subscribe(notified.append)
    assert [str(d) for d in live.apply(SLOW, can_undo=True)] == ["behaviors.arbiter.base_velocity_m_s: 0.3 → 0.2"]
    assert (live.current, live.initial, notified) == (SLOW, START, [SLOW])
    assert live.apply(with_velocity(0.2), can_undo=True) == ()
    assert notified == [SLOW], "an unchanged value is no change"


@pytest.mark.promise("P11")
def test_a_check_refuses_as_a_whole_and_changes_nothing() -> None:
    live = LiveSettings(START)

    def invalid() -> Settings:
        raise ConfigError("first problem", "second problem")

    assert live.check(invalid).problems == ("first problem", "second problem")
    restart = load_settings("hallway", ["cycle.rate_hz=10", "behaviors.arbiter.base_velocity_m_s=0.2"])
    (problem,) = live.check(lambda: restart).problems
    assert problem.endswith("needs a restart")
    assert live.check(lambda: SLOW).settings is SLOW
    assert live.current is START


def test_undo_goes_back_change_by_change() -> None:
    live = LiveSettings(START)
    assert live.undo() == ()
    live.apply(SLOW, can_undo=True)
    live.apply(FAST, can_undo=True)
    assert [str(d) for d in live.undo()] == ["behaviors.arbiter.base_velocity_m_s: 0.4 → 0.2"]
    live.undo()
    assert live.current == START
    assert live.undo() == ()


def test_a_change_that_cannot_be_undone_ends_the_history() -> None:
    live = LiveSettings(START)
    live.apply(SLOW, can_undo=True)
    live.apply(FAST, can_undo=False)
    assert live.undo() == ()
    assert velocity(live) == 0.4


def test_undo_keeps_a_model_that_was_added() -> None:
    live = LiveSettings(START)
    live.apply(SLOW, can_undo=True)
    added = START.models[0].model_copy(update={"name": "another"})
    live.apply(SLOW.model_copy(update={"models": (*SLOW.models, added)}), can_undo=True)
    assert [str(d) for d in live.undo()] == ["behaviors.arbiter.base_velocity_m_s: 0.2 → 0.3"]
    assert live.current.models == (*START.models, added)
    assert live.undo() == ()


def test_the_history_is_bounded() -> None:
    live = LiveSettings(START)
    for k in range(UNDO_MAX + 3):
        live.apply(with_velocity(0.1 + 0.001 * k), can_undo=True)
    undone = 0
    while live.undo():
        undone += 1
    assert undone == UNDO_MAX
    assert velocity(live) == pytest.approx(0.102)
