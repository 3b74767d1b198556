"""SIGHUP to a robot that drives: what is live changes in the next cycle, what is wrong changes nothing."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from runtime.recording.channels import SETTINGS
from runtime.recording.reader import open_recording
from tests.hil.machine import stalls_excused
from tests.hil.running import Running, emulated, running, wait_for
from tests.hil.truth import is_driving, rows
from tests.recorded import entries_of

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]


def events(run: Running) -> list[dict[str, object]]:
    lines = (run.folder / f"{run.name}.jsonl").read_text("utf-8").split("\n")[:-1]
    return [event for event in map(json.loads, lines) if "configuration" in str(event["event"])]


def reloaded(run: Running, config: Path, text: str, times: int) -> dict[str, object]:
    """Write the file, ask for a reload, and return how it ended."""
    config.write_text(text, encoding="utf-8")
    run.signal(signal.SIGHUP)
    wait_for(lambda: len(events(run)) >= times, "the end of a reload")
    return events(run)[-1]


@pytest.mark.promise("P11")
@stalls_excused
def test_a_configuration_reloaded_while_driving(tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    good = 'robot = "denning"\n[behaviors.arbiter]\nbase_velocity_m_s = 0.3\n'
    config.write_text(good, encoding="utf-8")
    recorded = tmp_path / "run.mcap"
    with (
        emulated(tmp_path) as robot,
        running(tmp_path, "run", "run", str(config), "--port", robot.port, "--arm", "--record", str(recorded)) as run,
    ):
        wait_for(lambda: is_driving(robot.trace), "driving")
        bad = reloaded(run, config, good.replace("0.3", '"fast"'), 1)
        assert bad["event"] == "the new configuration is refused"
        assert str(bad["problem"]).startswith(f"{config}: behaviors.arbiter.base_velocity_m_s = ")
        fixed = reloaded(run, config, good.replace("0.3", "0.05") + "[link]\nbaud = 9600\n", 2)
        assert str(fixed["problem"]).startswith("link.baud: ")
        assert str(fixed["problem"]).endswith("needs a restart")
        assert is_driving(robot.trace), "neither changed anything"
        slow = good.replace("0.3", "0.05") + '[ring]\nfiring = "quadrants"\n'
        taken = reloaded(run, config, slow, 3)
        assert taken["event"] == "the new configuration is in use"
        wait_for(lambda: 0.0 < rows(robot.trace)[-1].v < 0.1, "driving slowly")
        assert run.modes()[-1] == "DRIVE"
        run.signal(signal.SIGTERM)
        assert run.end() == 0
    assert sum(entry.topic == SETTINGS for entry in entries_of(recorded)) == 1
    assert run_command(["replay", str(recorded), "--verify"]) == DONE
    with open_recording(recorded) as recording:
        assert recording.world is None, "the world of a real port is unknown"
