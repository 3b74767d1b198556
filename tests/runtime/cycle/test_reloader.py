"""Reloading at run time: off the loop, one attempt at a time, the newest request counts, every result is logged."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
import structlog
from structlog.testing import LogCapture

from config.load import ConfigError, load_settings
from config.places import PlaceConfig, PlacesConfig
from config.settings import PerceptionConfig, Settings
from perception.pipeline import Perception
from runtime.cycle.live_settings import LiveSettings
from runtime.cycle.reloader import Reloader

BEFORE = load_settings("hallway")
SLOWER = load_settings("hallway", ["behaviors.arbiter.base_velocity_m_s=0.2"])


class Scripted:
    """Proposes scripted settings; can be blocked."""

    def __init__(self, *answers: Settings | Exception) -> None:
        self.answers = list(answers)
        self.started = threading.Event()
        self.unblocked = threading.Event()
        self.unblocked.set()
        self.threads: set[int] = set()
        self.taken: list[Settings] = []
        self.log = LogCapture()
        self.prepared: list[tuple[Settings, Settings]] = []
        self.problem: str | None = None
        logger: Any = structlog.wrap_logger(structlog.PrintLogger(), processors=[self.log])
        self.live_settings = LiveSettings(BEFORE)
        self.live_settings.subscribe(self.taken.append)
        self.reloader = Reloader(self.live_settings, self._propose, logger, self._prepare)

    async def _prepare(self, running: Settings, proposed: Settings) -> str | None:
        self.prepared.append((running, proposed))
        return self.problem

    def _propose(self) -> Settings:
        self.threads.add(threading.get_ident())
        self.started.set()
        assert self.unblocked.wait(60.0)
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    async def attempt(self) -> str:
        self.reloader.request()
        await self.reloader.settled()
        return str(self.log.entries[-1]["event"])


@pytest.mark.promise("P11")
async def test_the_last_valid_configuration_is_kept_until_a_valid_one_comes() -> None:
    script = Scripted(ConfigError("a", "b"), RuntimeError("of ours"), BEFORE, SLOWER, SLOWER)
    assert await script.attempt() == "the new configuration is refused"
    assert [entry.get("problem") for entry in script.log.entries] == ["a", "b"]
    assert await script.attempt() == "the configuration cannot be read and stays as it is"
    assert "of ours" in script.log.entries[-1]["error"]
    assert await script.attempt() == "the configuration has not changed"
    assert script.taken == []
    assert await script.attempt() == "the new configuration is in use"
    assert script.log.entries[-1]["changed"] == ["behaviors.arbiter.base_velocity_m_s: 0.3 → 0.2"]
    assert await script.attempt() == "the configuration has not changed"
    assert script.taken == [SLOWER]
    assert threading.get_ident() not in script.threads


async def test_settings_that_cannot_be_prepared_are_not_applied() -> None:
    script = Scripted(SLOWER, SLOWER)
    script.problem = "models: no kernels"
    assert await script.attempt() == "the new configuration is refused"
    assert (script.log.entries[-1]["problem"], script.taken) == ("models: no kernels", [])
    script.problem = None
    assert await script.attempt() == "the new configuration is in use"
    assert script.prepared == [(BEFORE, SLOWER)] * 2


async def test_a_change_from_the_console_during_an_attempt_is_replaced_by_the_files() -> None:
    script = Scripted(SLOWER)
    faster = load_settings("hallway", ["behaviors.arbiter.base_velocity_m_s=0.4"])
    script.unblocked.clear()
    script.reloader.request()
    assert await asyncio.to_thread(script.started.wait, 30.0)
    script.live_settings.apply(faster, can_undo=True)
    script.unblocked.set()
    await script.reloader.settled()
    assert script.taken == [faster, SLOWER]
    assert script.log.entries[-1]["changed"] == ["behaviors.arbiter.base_velocity_m_s: 0.4 → 0.2"]
    assert script.live_settings.undo() == ()


HALL, YARD = (PlacesConfig(place=(PlaceConfig(name=name, x_m=1.0, y_m=0.0),)) for name in ("hall", "yard"))


def placed(settings: Settings, places: PlacesConfig) -> Settings:
    return settings.model_copy(update={"places": places})


async def test_places_that_an_operator_sets_during_an_attempt_stay() -> None:
    """A no-go area that is drawn while kernels are compiled must not vanish with the end of that."""
    script = Scripted(SLOWER)
    prepare = script._prepare

    async def slow(running: Settings, proposed: Settings) -> str | None:
        script.live_settings.apply(placed(script.live_settings.current, YARD), can_undo=True)
        return await prepare(running, proposed)

    script.reloader._prepare = slow
    assert await script.attempt() == "the new configuration is in use"
    assert script.live_settings.current == placed(SLOWER, YARD)


async def test_places_of_the_files_are_taken_once_and_then_the_operators_count() -> None:
    script = Scripted(*[placed(BEFORE, HALL)] * 2)
    assert await script.attempt() == "the new configuration is in use"
    assert script.live_settings.current.places == HALL
    script.live_settings.apply(placed(BEFORE, YARD), can_undo=True)
    assert await script.attempt() == "the configuration has not changed"
    assert script.live_settings.current.places == YARD


async def test_requests_during_an_attempt_lead_to_one_more() -> None:
    script = Scripted(BEFORE, SLOWER)
    script.unblocked.clear()
    script.reloader.request()
    assert await asyncio.to_thread(script.started.wait, 30.0)
    for _ in range(4):
        script.reloader.request()
    script.unblocked.set()
    await script.reloader.settled()
    assert script.answers == [], "five requests are two attempts: one under way, one after it"
    assert script.taken == [SLOWER]


async def test_the_end_of_a_run_drops_the_attempt_in_progress() -> None:
    script = Scripted(SLOWER)
    script.unblocked.clear()
    script.reloader.request()
    assert await asyncio.to_thread(script.started.wait, 30.0)
    script.reloader.cancel()
    script.unblocked.set()
    await script.reloader.settled()
    assert script.taken == []


@pytest.mark.parametrize("method", ["paper", "bayes"])
def test_perception_continues_with_other_settings(method: str) -> None:
    """Its state is kept, and new values are in force at once."""
    config = PerceptionConfig.model_validate({"method": method})
    perception = Perception(BEFORE.ring, BEFORE.models, config)
    other = PerceptionConfig.model_validate(
        {"method": method, "bayes": {"attempts_per_firing": 7, "report_probability": 0.5}, "map": {"age_max_s": 3.0}}
    )
    inner: Any = perception.method
    remembered = inner.memory if method == "bayes" else inner.outline.segments
    perception.apply_settings(other)
    if method == "bayes":
        assert inner.memory is remembered
        assert inner.settings[0].attempts_per_firing == 7
        assert inner._config.report_probability == 0.5
    else:
        assert inner.outline.segments is remembered
        assert inner.outline._config.age_max_s == 3.0
