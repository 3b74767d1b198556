"""The whole way in real time: serial bytes to wheel commands to the paper's six drums, and every orderly end."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from config.load import load_settings
from drivers.messages import Flags
from runtime.books import Books
from runtime.pacing import Pacer
from runtime.rhythm import LATE_SHARE
from tests.hil.running import Emulated, Running, emulated, is_driving, reaches, rows, running, wait_for

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

FT = 0.3048
SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz
DRIVE_S = 26
"""Down the hallway and out of it; the drums are all known by then."""


async def bare_loop(running_too: Running) -> Books:
    """Do nothing at all at 20 Hz while the robot drives: what this machine does to any loop just now."""
    books, pacer = Books(LATE_SHARE * PERIOD_S), Pacer(time.monotonic(), PERIOD_S)
    while running_too.process.poll() is None:
        start_s = time.monotonic()
        books.enter(0.0, start_s - pacer.deadline_s)
        await asyncio.sleep(max(0.0, pacer.advance(time.monotonic()) - time.monotonic()))
    return books


def summary_of(path: Path) -> dict[str, Any]:
    got = json.loads(path.read_bytes())
    assert isinstance(got, dict)
    return got


def test_six_drums_in_real_time_beside_a_bare_loop(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    with running(tmp_path, "run", "run", "--seconds", str(DRIVE_S), "--json", str(path)) as run:
        bare = asyncio.run(bare_loop(run))
        assert run.end() == 0
    assert run.complaints == []
    summary = summary_of(path)

    world = SETTINGS.world
    assert world is not None
    drums = [(d.x_m - world.start.x_m, d.y_m - world.start.y_m) for d in world.drum]
    seen = [(o["x"], o["y"]) for o in summary["objects"]]
    assert len(seen) == len(drums) == 6
    errors = [min(math.dist(drum, place) for place in seen) for drum in drums]
    assert len({min(range(6), key=lambda k, d=drum: math.dist(d, seen[k])) for drum in drums}) == 6  # type: ignore[misc]
    assert sum(errors) / 6 <= 0.25 * FT
    assert max(errors) <= 0.35 * FT

    assert summary["link"]["frames"] > 50 * DRIVE_S
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert summary["cycles"] + summary["missed"] == pytest.approx(DRIVE_S / PERIOD_S, abs=2)
    figures = {"late": summary["late"], "bare late": bare.late, "lag": summary["lag_us"], "bare lag": bare.lag_us(),
               "cycle": summary["cycle_us"], "errors": errors, "missed": summary["missed"]}  # fmt: skip
    logging.getLogger(__name__).info("%s", figures)
    # The margin: one cycle in fifty. The loop that drives also has bytes to read when its deadline comes.
    assert summary["late"] <= bare.late + 0.02 * summary["cycles"], figures
    assert summary["missed"] <= 2, figures
    assert summary["lag_us"]["p50"] <= bare.lag_us()["p50"] + 2000.0, figures


def drive(folder: Path, robot: Emulated, name: str = "run", *more: str) -> Any:
    return running(folder, name, "run", "--port", robot.port, *more)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_halts_the_base_before_the_end(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "summary.json"
    with emulated(tmp_path) as robot:
        with drive(tmp_path, robot, "run", "--arm", "--json", str(path)) as run:
            wait_for(lambda: is_driving(robot.trace), "driving")
            signalled_s = run.signal(number)
            assert run.end() == 0
            ended_s = time.monotonic()
        wait_for(lambda: reaches(robot.trace, ended_s + 0.3), "trace beyond the end")
        latched_s = next(row.host_s for row in rows(robot.trace) if row.flags & Flags.LATCHED)
        assert signalled_s - 0.1 < latched_s < ended_s, "the base latched before the program ended"
        after = [row for row in rows(robot.trace) if row.host_s > latched_s + 0.15]
        assert after
        assert all(row.still and row.flags & Flags.LATCHED for row in after)
        assert ended_s - signalled_s < 3.0
    assert run.complaints == []
    summary = summary_of(path)
    assert summary["mode"] == "DRIVE"
    assert summary["link"]["bad"] == 0


def test_unarmed_it_waits_until_it_is_armed_and_drives_only_then(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot, drive(tmp_path, robot) as run:
        run.comes_to("READY")
        ready_s = time.monotonic()
        wait_for(lambda: reaches(robot.trace, ready_s + 1.5), "a while in READY")
        assert all(row.still for row in rows(robot.trace)), "it moved without being armed"
        assert run.modes() == ["READY"]
        run.signal(signal.SIGUSR1)
        wait_for(lambda: is_driving(robot.trace), "driving")
        run.comes_to("DRIVE")
        run.signal(signal.SIGINT)
        assert run.end() == 0
        assert run.complaints == []


def test_two_runs_in_a_row_on_the_same_robot(tmp_path: Path) -> None:
    """The first leaves the base latched and bytes in the pty; the second releases it and drives on."""
    with emulated(tmp_path) as robot:
        for name in ("first", "second"):
            path = tmp_path / f"{name}.json"
            begun_s = time.monotonic()
            with drive(tmp_path, robot, name, "--arm", "--seconds", "2.5", "--json", str(path)) as run:
                assert run.end() == 0
            assert run.modes() == ["READY", "DRIVE"]
            assert run.complaints == []
            assert max(row.v for row in rows(robot.trace) if row.host_s > begun_s) > 0.2
            summary = summary_of(path)
            assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
            assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
            assert rows(robot.trace)[-1].flags & Flags.LATCHED


def test_from_start_to_first_cycle_within_five_seconds(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        begun_s = time.monotonic()
        with drive(tmp_path, robot) as run:
            run.comes_to("READY")
            assert time.monotonic() - begun_s < 5.0
