"""The history of a run: enough for a page that is reloaded, bounded, and gone after a reset of the odometry."""

from __future__ import annotations

import orjson

from drivers.messages import Flags, Odometry, Pose, Twist
from runtime.console.frames.run_history import SAMPLES_MAX, TRAIL_MAX, RunHistory
from tests.runtime.console.console_case import open_console


def odometry(k: int) -> Odometry:
    return Odometry(0.05 * k, Pose(0.02 * k, 0.0, 0.0), 0.0, Twist(0.4, 0.0), Flags.NONE, 0)


def test_it_is_thinned_and_bounded() -> None:
    history = RunHistory()
    for k in range(200):
        history.take(odometry(k), lambda: [1.5, -1.0, None], lambda: {"perceive": 1e-3})
    found = history.listed()
    times = [sample["robot_s"] for sample in found["samples"]]
    assert len(times) == 10, "one a second"
    assert 60 <= len(found["trail"]) <= 80, "a place every 5 cm"
    for k in range(200, 40_000, 20):
        history.take(odometry(k), lambda: [1.5] * 24, lambda: {"perceive": 1e-3})
    found = history.listed()
    assert len(found["samples"]) == SAMPLES_MAX
    assert len(found["trail"]) <= TRAIL_MAX
    assert len(orjson.dumps(found)) < 200_000
    history.clear()
    assert history.listed() == {"samples": [], "trail": []}


async def test_a_page_that_is_opened_late_is_sent_it() -> None:
    async with open_console() as case:
        case.cycles(60)
        page = await case.connect()
        past = (await page.next("session"))["history"]
        assert len(past["samples"]) >= 2
        assert len(past["trail"]) > 10
        assert past["samples"][-1]["ranges"].count(None) < 24
