"""The log of missions: every step and the end, once each, and bounded."""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Any, NoReturn

import structlog

from behaviors.missions.mission import Mission, goes_to
from config.mission import MissionConfig
from runtime.cycle.drive_requests import Legs
from runtime.cycle.logs.mission_log import LINES_BURST, LINES_PER_S, STEPS_MAX, MissionLog

PLAN = MissionConfig.model_validate({
    "name": "there", "endless": True, "step": [
        {"name": "out", "schemas": [{"name": "move_ahead", "distance_m": 1.0}]},
        {"name": "back", "schemas": [{"name": "turn", "heading_deg": 180.0}],
         "until": [{"when": "reached", "go": "out"}, {"when": "time", "after_s": 9.0, "go": "failed"}]},
    ],
})  # fmt: skip


def test_every_step_and_the_end_are_noted_once_and_no_more_than_are_read() -> None:
    lines = list[dict[str, Any]]()

    def keep(_logger: object, _method: str, event: MutableMapping[str, Any]) -> NoReturn:
        lines.append(dict(event))
        raise structlog.DropEvent

    log = MissionLog(structlog.wrap_logger(None, processors=[keep]))
    log.observe(Legs(), 7000.0)
    noted = log.row
    assert noted is None
    mission = Mission(PLAN)
    for after_s, target, why in ((1.0, "next", "reached"), (2.0, "out", "reached"), (3.0, "failed", "time")):
        log.observe(mission, 7000.0 + after_s)
        log.observe(mission, 7000.5 + after_s)
        mission = goes_to(mission, target, why)
    log.observe(mission, 7004.0)
    assert log.row is not None
    assert [(row["after_s"], row["step"], row["status"]) for row in log.row["steps"]] == [
        (1.0, "out", "running"), (2.0, "back", "running"), (3.0, "out", "running"), (4.0, "out", "failed"),
    ]  # fmt: skip
    assert (log.row["name"], log.row["status"]) == ("there", "failed")
    assert log.row["reason"] == "the mission there has failed: time"
    assert [line["step"] for line in lines] == ["out", "back", "out", "out"]
    mission = Mission(PLAN)
    for k in range(3 * STEPS_MAX):
        log.observe(mission, 7005.0)
        mission = goes_to(mission, "back" if k % 2 else "out", "reached")
    assert len(log.row["steps"]) == STEPS_MAX
    assert len(lines) <= LINES_BURST + 5.0 * LINES_PER_S + 1
