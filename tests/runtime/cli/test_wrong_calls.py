"""What a user can get wrong in a call of each command."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["run", "--frobnicate"], "--frobnicate"),
    (["run", "hallway", "irregular"], "irregular"),
    (["run", "--port"], "--port"),
    (["run", "--port", "nowhere"], "nowhere"),
    (["run", "--port", "/dev/nowhere", "--headless"], "/dev/nowhere"),
    (["run", "--port", "regular", "--headless"], "regular"),
    (["run", "--port", "."], "."),
    (["run", "--port", ""], "port"),
    (["run", "--seconds", "0"], "--seconds 0"),
    (["run", "--seconds", "-1"], "--seconds"),
    (["run", "--seconds", "nan"], "--seconds nan"),
    (["run", "--seconds", "soon"], "soon"),
    (["run", "--seed", "x"], "--seed"),
    (["run", "--units", "yards"], "yards"),
    (["run", "--set"], "--set"),
    (["run", "--set", "ring"], "ring"),
    (["run", "--set", "ring.firing=octants"], "octants"),
    (["run", "--set", "cycle.rate_hz=0"], "cycle.rate_hz"),
    (["run", "--set", "cycle.rate=20"], "cycle.rate"),
    (["run", "--set", "ring.firing.step_period_s=0.001"], "step_period_s"),
    (["run", "--set", "log.file='regular/run.jsonl'", "--headless"], "regular/run.jsonl"),
    (["run", "--set", "log.file='~nosuchuser/run.jsonl'", "--headless"], "~nosuchuser"),
    (["run", "--set", "recording.folder='~nosuchuser/runs'", "--headless"], "~nosuchuser"),
    (["run", "--set", "log.file='\udcff'", "--headless"], "not UTF-8"),
    (["run", "--port", "\udcff", "--headless"], "not UTF-8"),
    (["run", "\udcff.toml"], "file not found"),
    (["run", "halway"], "halway"),
    (["run", "./halway.toml"], "halway.toml"),
    (["run", "broken.toml"], "broken.toml: line 3"),
    (["run", "--world", "halway"], "halway"),
    (["run", "--world", "./nowhere.toml"], "nowhere.toml"),
    (["run", "--world", "broken.toml"], "broken.toml: line 3"),
    (["run", "--world", "drum.toml"], "drum.0.y_m"),
    (["run", "--world", "latin.toml"], "latin.toml"),
    (["run", "--world", "."], "."),
    (["run", "--map", "halway"], "halway"),
    (["run", "--map", "./nowhere.toml"], "nowhere.toml"),
    (["run", "--map", "broken.toml"], "broken.toml: line 3"),
    (["run", "--headless", "--seconds", "1", "--faults", "fault_broken.toml"], "fault_broken.toml: line 1"),
    (["run", "--headless", "--seed", "-1"], "-1"),
    (["emulate", "--faults", "fault.toml"], "earthquake"),
    (["emulate", "--faults", "fault_broken.toml"], "fault_broken.toml: line 1"),
    (["emulate", "--faults", "nowhere.toml"], "nowhere.toml"),
    (["emulate", "--world", "halway"], "halway"),
    (["emulate", "--robot", "dening"], "dening"),
    (["emulate", "--config", "halway"], "halway"),
    (["emulate", "--seed", "1.5"], "1.5"),
    (["emulate", "--seed", "-1"], "-1"),
    (["check"], "CONFIG"),
    (["check", "halway"], "halway"),
    (["check", "broken.toml"], "broken.toml: line 3"),
    (["check", "nowhere.toml"], "nowhere.toml"),
    (["check", "drum.toml"], "y_m"),
    (["figures", "good.csv"], "--out"),
    (["export", "good.csv", "--out", "x", "--to", "xml"], "xml"),
    (["experiment", "hallway", "--seeds", "1.5"], "1.5"),
    (["experiment"], "NAME"),
    (["experiment", "corridor"], "corridor"),
    (["experiment", "hallway", "--method", "psychic"], "psychic"),
    (["experiment", "hallway", "--seeds", "0"], "--seeds 0"),
    (["experiment", "hallway", "--seeds", "many"], "many"),
    (["experiment", "hallway", "--world", "empty.toml"], "drum"),
    (["experiment", "hallway", "--json"], "--json"),
    (["experiment", "irregular", "--scene", "clean"], "--scene"),
    (["experiment", "hallway", "--scene", "clean", "--world", "hallway"], "--scene"),
    (["experiment", "hallway", "--scene", "clean", "--out", "x"], "nothing to record"),
    (["experiment", "budget", "--scene", "clean"], "a hall of its own"),
    (["experiment", "budget", "--world", "hallway"], "a hall of its own"),
    (["experiment", "budget", "--seeds", "0"], "--seeds 0"),
    (["ros2", "--connect"], "--connect"),
    (["ros2-robot", "--out", "x.toml"], "--radius"),
    (["foxglove", "--port", "many"], "many"),
    (["foxglove", "--port", "70000"], "65535"),
    (["fleet", "--port", "99999"], "65535"),
    (["run", "--port", "/dev/null", "--world", "office"], "--world"),
    (["run", "--port", "/dev/null", "--trace", "x.csv", "--faults", "x.toml"], "--trace, --faults"),
    (["run", "--record", "x.mcap", "--no-record"], "exclude"),
    (["run", "--foxglove", "--set", "console.enabled=false"], "console.enabled"),
    (["experiment", "budget", "--out", "x"], "--out"),
    (["service", "nosuch", "--port", "/dev/ttyUSB0"], "nosuch"),
    (["service", "--port", "/dev/ttyUSB0", "--set", "ring.nosuch=3"], "nosuch"),
    (["init", "robot", "x.toml", "--sensors", "12.7"], "12.7"),
    (["ros2-robot", "--radius", "0.3"], "--out"),
    (["ros2-robot", "--radius", "0", "--out", "x.toml"], "--radius"),
    (["firmware"], "--board"),
    (["firmware", "--board", "uno", "--out", "x"], "uno"),
    (["firmware", "--board", "pico"], "--out"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)


FAILING: Calls = [
    (["settings", "--out", 300 * "a"], "too long"),
    (["run", "--headless", "--json", "nowhere/x.json"], "nowhere/x.json"),
    (["run", "--headless", "--record", "nowhere/x.csv"], "nowhere/x.csv"),
    (["run", "--headless", "--record", "regular/x.csv"], "regular/x.csv"),
    (["emulate", "--link", "regular"], "regular"),
    (["emulate", "--link", "nowhere/robot"], "nowhere/robot"),
    (["emulate", "--trace", "nowhere/x.csv"], "nowhere/x.csv"),
    (["experiment", "hallway", "--method", "paper", "--json", "nowhere/x.json"], "nowhere/x.json"),
    (["firmware", "--board", "pico", "--out", "regular"], "regular"),
]


@pytest.mark.parametrize(("arguments", "cause"), FAILING, ids=call_name)
def test_work_that_failed(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, FAILED, capfd)
    assert Path("regular").read_bytes() == b""


@pytest.mark.parametrize("arguments", [["service"], ["service", "hallway"], ["service", "--port", "a\nb"]])
def test_a_service_needs_a_printable_port(arguments: list[str], capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, "printable" if "--port" in arguments else "--port", WRONG_CALL, capfd)
