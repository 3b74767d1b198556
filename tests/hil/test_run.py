"""The command on the emulator's pty, from the start to every kind of end: only what needs the real processes.

A busy machine may stop a drive at any time, because the base's deadman or a gap between two cycles is measured by the
clock. So these tests arm the robot again, and expect events in their order, but never a time.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.errors import FAILED
from drivers.messages import Flags
from runtime.recording.channels import LOG
from runtime.recording.reader import open_recording
from tests.hil.running import DEADMAN_S, PATIENT, emulated, running, start_url, wait_for
from tests.hil.truth import Row, Truth
from tests.rawpage import RawPage

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

STOPPED_WITHIN_S = DEADMAN_S + 0.3
"""The deadman, and the ramp down to a stop, by the robot's clock, s."""
QUIET = ("--no-record", "--no-console", *PATIENT)
BOX = 'name = "crate"\nclosed = true\nvertices_m = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]\n'
SETTINGS = 'robot = "denning"\nbehaviors.move_ahead.distance_m = {}\n'
VELOCITY, DISTANCE = "behaviors.arbiter.base_velocity_m_s", "behaviors.move_ahead.distance_m"


def stops_by_itself(truth: Truth) -> Row:
    """Wait until the base stands still by its deadman, and return a row from then; no command comes any more."""
    now_s = time.monotonic()
    # What was sent before is read by then, also by an emulator that was kept waiting.
    here = truth.wait(lambda row: row.host_s > now_s, "the robot's time")
    return truth.wait(
        lambda row: row.t_s > here.t_s + STOPPED_WITHIN_S and row.still and bool(row.flags & Flags.DEADMAN),
        "a standstill by the deadman",
    )


def is_driving(row: Row) -> bool:
    return row.driving and not row.flags & Flags.LATCHED


def is_halted(row: Row) -> bool:
    return row.still and bool(row.flags & Flags.LATCHED)


@pytest.mark.promise("P13")
def test_a_robot_has_one_owner_until_that_is_killed(tmp_path: Path) -> None:
    """A lock that outlived its owner would keep the robot from every other run; here it ends with the process."""
    latency = tmp_path / "latency.csv"
    with emulated(tmp_path, "--latency", str(latency)) as robot:
        truth = Truth(robot.trace)
        with running(tmp_path, "first", "run", "--port", robot.port, "--arm", *QUIET) as first:
            first.drive(truth)
            with running(tmp_path, "other", "run", "--port", robot.port, "--arm", *QUIET) as other:
                assert other.end() == FAILED
                assert other.out == ""
                (line,) = other.error_lines
                assert robot.port in line
                assert "in use" in line
            assert first.process.poll() is None
            first.drive(truth)
            first.process.kill()
            first.process.wait()
            assert "console" not in first.err
        stopped = stops_by_itself(truth)
        with running(tmp_path, "second", "run", "--port", robot.port, *QUIET) as second:
            wait_for(lambda: "READY" in second.modes(), "READY", lambda: second.err)
            assert all(row.still for row in truth.since(stopped.t_s)), "it moved without being armed"
            second.drive(truth)
            second.signal(signal.SIGINT)
            assert second.end() == 0
            assert second.error_lines == []
        truth.wait(is_halted, "the halt of its end")
    assert {line.split(",")[1] for line in latency.read_text().splitlines()[1:]} == {"echo", "drive"}


def message(page: RawPage, kind: str, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the next message of a kind that is wanted."""
    found: list[dict[str, Any]] = []

    def is_found() -> bool:
        found[:] = [page.next(kind)]
        return wanted(found[0])

    wait_for(is_found, f"the {kind}", lambda: found)
    return found[0]


def frame_in(page: RawPage, mode: str) -> dict[str, Any]:
    """Return the next frame in a mode; the robot is armed for it where it must drive."""

    def is_in(frame: dict[str, Any]) -> bool:
        if mode == "DRIVE" and frame["mode"] in {"READY", "SAFE_STOP"}:
            assert page.ask(type="arm")["ok"]
        return bool(frame["mode"] == mode)

    return message(page, "state", is_in)


def values_of(parameters: dict[str, Any]) -> dict[str, Any]:
    return {row["path"]: row["value"] for row in parameters["parameters"]}


def crates(frame: dict[str, Any]) -> list[int]:
    """Return the numbers of the objects that are crates."""
    return [o["number"] for o in frame["objects"] if o["model"] == "crate"]


def test_a_run_from_its_start_url_to_its_end(tmp_path: Path) -> None:
    recording, more, summary = tmp_path / "run.mcap", tmp_path / "more.toml", tmp_path / "summary.json"
    more.write_text(SETTINGS.format(6.1), "utf-8")
    with (
        emulated(tmp_path, fresh=True) as robot,
        running(
            tmp_path, "run", "run", str(more), "--port", robot.port, "--record", str(recording), "--json",
            str(summary), "--set", "console.port=0", *PATIENT, fresh=True,
        ) as run,
    ):  # fmt: skip
        truth, url = Truth(robot.trace), start_url(run)
        wait_for(lambda: "from elsewhere ssh -L " in run.err, "the console's line in the terminal")
        page = RawPage(url)
        session = page.next("session")
        assert (session["role"], session["emulated"], session["truth"]) == ("control", False, None)

        assert page.ask(type="set_parameter", path=VELOCITY, value=0.2)["ok"]
        assert frame_in(page, "DRIVE")["controller"]
        assert page.ask(type="halt")["ok"]
        frame_in(page, "SAFE_STOP")
        truth.wait(is_halted, "the halt")

        more.write_text(SETTINGS.format(5.0), "utf-8")
        run.signal(signal.SIGHUP)
        values = message(page, "parameters", lambda it: values_of(it)[DISTANCE] == 5.0)
        assert values_of(values)[VELOCITY] == 0.3, "the value of the file replaces the operator's"

        frame_in(page, "DRIVE")
        assert page.ask(type="load_model", toml=BOX)["data"] == {"name": "crate"}
        assert page.ask(type="place_model", model="crate", x=2.0, y=1.0, theta=0.3)["ok"]
        (number,) = crates(message(page, "state", lambda it: crates(it) != []))
        assert page.ask(type="evidence", object=number)["ok"]
        assert page.ask(type="reject_object", object=number)["ok"]

        wait_for(lambda: bool(frame_in(page, "DRIVE")) and is_driving(truth.read()[-1]), "driving")
        run.signal(signal.SIGTERM)
        with pytest.raises(ConnectionError, match="the run is over"):
            page.next("nothing that is ever said")
        page.close()
        assert run.end() == 0
        assert run.error_lines == []
        truth.wait(is_halted, "the halt of its end")
    log, token = (tmp_path / "run.jsonl").read_text("utf-8"), url.partition("token=")[2]
    assert token in log
    assert '"event":"a part' not in log
    with open_recording(recording) as recorded:
        lines = [bytes(entry.data).decode() for entry in recorded.messages() if entry.topic == LOG]
    assert [line for line in lines if '"console"' in line]
    assert not [line for line in lines if token in line]
    assert json.loads(summary.read_text("utf-8"))["process"]["compilations"] == 0


def is_ended(pid: int) -> bool:
    """Return whether a process has ended; its new parent need not have collected it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


STOPPED_S = 3.5
"""Longer than the pty's buffer takes the robot's bytes, by the robot's clock, s."""


def test_stopped_and_killed_while_driving_on_its_own_emulator(tmp_path: Path) -> None:
    """The base stops by itself; it moves again once armed; the emulator sees its robot to a stop and then ends."""
    trace = tmp_path / "trace.csv"
    with running(tmp_path, "run", "run", "--trace", str(trace), *QUIET) as run:
        wait_for(trace.exists, "the trace", lambda: run.err)
        truth = Truth(trace)
        truth.wait(lambda _: True, "a row")
        run.drive(truth)
        stops = run.modes().count("SAFE_STOP")
        run.signal(signal.SIGSTOP)
        stopped = stops_by_itself(truth)
        last = truth.wait(lambda row: row.t_s > stopped.t_s + STOPPED_S, "the robot's time")
        assert all(row.still for row in truth.since(stopped.t_s))

        run.signal(signal.SIGCONT)
        wait_for(lambda: run.modes().count("SAFE_STOP") > stops, "SAFE_STOP", lambda: (run.modes(), run.err))
        # A DRIVE that was about to be written when the process was stopped leaves now, with a HALT right behind it.
        latched = truth.wait(lambda row: row.t_s > last.t_s and is_halted(row), "the halt")
        until = truth.wait(lambda row: row.t_s > latched.t_s + 0.3, "a while in SAFE_STOP")
        assert all(row.still for row in truth.since(latched.t_s) if row.t_s <= until.t_s)

        run.drive(truth)
        assert run.error_lines == []
        (emulator,) = map(int, Path(f"/proc/{run.process.pid}/task/{run.process.pid}/children").read_text().split())
        assert not is_ended(emulator)
        run.signal(signal.SIGKILL)
        run.process.wait()
        stops_by_itself(truth)
        wait_for(lambda: is_ended(emulator), "the emulator's own end")
        assert truth.read()[-1].still
