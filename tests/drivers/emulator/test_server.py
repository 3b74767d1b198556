"""The emulator in real time, by a clock that the test controls: every way a host can treat it badly."""

from __future__ import annotations

import asyncio
import itertools
import os
import signal
from pathlib import Path

import pytest

from drivers.denning.frames import Ack, Drive, Echo, Hello, Ident, Odom, Pattern
from drivers.emulator.port_link import EmulatorError
from drivers.emulator.pty_transport import PtyPort
from drivers.emulator.server import LAG_MAX_S, LINGER_S, SlippingClock, wait_for_host
from drivers.emulator.truth_trace import HEADER
from drivers.messages import Flags
from tests.drivers.device_host import script
from tests.drivers.emulator.pty_host import TICK_S, Host, emulator, rows
from tests.hil.machine import TIMEOUT_S

ROUNDING_S = 2e-6
"""A column of a trace is written to the microsecond."""


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "robot"


# The robot on the line.


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_it_answers_fires_and_ends_at_a_signal(link: Path, number: signal.Signals) -> None:
    async with emulator(link) as robot:
        assert robot.path == str(link)
        with Host(robot) as host:
            host.send(Hello(0), Pattern(1, 50, 255, (1, 2, 4)))
            await host.until(lambda: len(host.of(Echo)) >= 4 and len(host.of(Odom)) >= 10, "echoes")
            assert host.of(Ident)[0].name == "denning"
            assert [ack.of for ack in host.of(Ack)] == [1]
            times = [odom.t_us for odom in host.of(Odom)]
            assert times == list(range(times[0], times[-1] + 1, 20_000))
            assert host.decoder.bad == 0
        signal.raise_signal(number)
        await asyncio.wait_for(robot.task, TIMEOUT_S)
        assert not link.is_symlink()


async def test_its_time_is_the_clocks_and_the_truth_is_written_while_it_runs(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "truth.csv"
    async with emulator(link, trace=trace) as robot:
        await robot.until(lambda: len(rows(trace)) >= 60, "rows")
        assert trace.read_text().startswith(HEADER + "\n")
        for before, after in itertools.pairwise(rows(trace)):
            robot_s, host_s = (after[name] - before[name] for name in ("t_s", "host_s"))
            assert robot_s == pytest.approx(host_s, abs=2 * ROUNDING_S)
            # A row is due a tick after the last one, to the bit, or else with the next tick.
            assert robot_s <= 2 * TICK_S + ROUNDING_S
        assert robot.clock.now_s - rows(trace)[-1]["host_s"] <= 2 * TICK_S + ROUNDING_S, "rows are not kept back"


async def test_a_suspended_emulator_goes_on_without_a_burst(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "truth.csv"
    async with emulator(link, trace=trace) as robot:
        with Host(robot) as host:
            await host.until(lambda: len(host.of(Odom)) >= 5, "odometry")
            before = rows(trace)[-1]
            robot.clock.now_s += 5.0
            count = len(host.of(Odom))
            await host.until(lambda: len(host.of(Odom)) >= count + 20, "odometry after the gap")
            assert host.decoder.bad == 0
    after = rows(trace)[-1]
    robot_s, host_s = (after[name] - before[name] for name in ("t_s", "host_s"))
    # All of the gap is skipped but what is caught up; the emulator was a few readings of the clock behind before it.
    assert 0.0 <= host_s - robot_s - (5.0 - LAG_MAX_S) <= 4 * TICK_S
    shift = [row["host_s"] - row["t_s"] for row in rows(trace)]
    assert all(b >= a - ROUNDING_S for a, b in itertools.pairwise(shift)), (
        "the robot's clock never gains on the host's"
    )


async def test_echo_and_command_are_stamped_by_the_clock(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "latency.csv"
    async with emulator(link, latency=trace) as robot:
        with Host(robot) as host:
            begin_s = robot.clock.now_s
            host.send(Hello(0), Pattern(1, 60, 100, (0b1,)))
            await host.until(lambda: host.of(Echo) != [], "an echo")
            heard_s = robot.clock.now_s
            host.send(Drive(2, 0, 0))
            await host.until(lambda: host.of(Odom)[-1].last_drive_seq == 2, "the command's number in the odometry")
            end_s = robot.clock.now_s
    header, *lines = trace.read_text().splitlines()
    assert header == "host_s,frame"
    stamps = [(float(line.split(",")[0]), line.split(",")[1]) for line in lines]
    (drive_s,) = [host_s for host_s, frame in stamps if frame == "drive"]
    first_echo_s = next(host_s for host_s, frame in stamps if frame == "echo")
    assert begin_s - ROUNDING_S <= first_echo_s <= heard_s + ROUNDING_S
    assert heard_s - ROUNDING_S <= drive_s <= end_s + ROUNDING_S
    assert stamps == sorted(stamps)


# Hosts.


async def test_hosts_come_and_go(link: Path) -> None:
    async with emulator(link) as robot:
        last_us = -1
        for seq in range(5):
            with Host(robot) as host:
                host.send(Hello(seq))
                await host.until(lambda: bool(host.of(Ident)) and len(host.of(Odom)) > 3, "an answer")
                assert host.of(Odom)[0].t_us > last_us
                last_us = host.of(Odom)[-1].t_us
        assert not robot.task.done()


async def test_last_words_of_a_host_are_heard(link: Path) -> None:
    async with emulator(link) as robot:
        with Host(robot) as host:
            host.send(Pattern(0, 50, 255, (1,)))
        with Host(robot) as host:
            await host.until(lambda: len(host.of(Echo)) >= 2, "echoes")


async def test_emulator_outlives_a_host_that_does_not_read(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "truth.csv"
    flood = script(kind="garbage", at_s=0.0, duration_s=1.0, bytes_per_s=150_000.0)
    async with emulator(link, baud=2_000_000, faults=flood, trace=trace) as robot:
        with Host(robot) as host:
            await robot.until(lambda: rows(trace)[-1:] != [] and rows(trace)[-1]["t_s"] > 1.5, "the end of the flood")
            await host.until(lambda: any(odom.t_us > 1_500_000 for odom in host.of(Odom)), "odometry after it")
            host.send(Hello(1))
            await host.until(lambda: len(host.of(Ident)) == 1, "an answer")
            assert host.bytes < 150_000, "unread output is not kept"


async def test_unplugging_hangs_up_and_plugging_in_links_again(link: Path) -> None:
    async with emulator(link, faults=script(kind="unplug", at_s=0.5, duration_s=0.5)) as robot:
        with Host(robot) as host:
            with pytest.raises(OSError, match=r"hung up|Input/output"):
                await host.until(lambda: False, "the unplugging")
            assert host.of(Odom)[-1].t_us <= 0.52e6
        assert not link.is_symlink()
        await robot.until(link.exists, "the link")
        with Host(robot) as host:
            host.send(Hello(3))
            await host.until(lambda: len(host.of(Ident)) == 1 and len(host.of(Odom)) > 0, "an answer")
            assert host.of(Odom)[0].t_us >= 1.0e6, "the robot ran on meanwhile"


async def test_without_its_parent_it_sees_the_robot_stop_and_ends(
    link: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace, parent = tmp_path / "truth.csv", [2]
    monkeypatch.setattr("drivers.emulator.server.os.getppid", lambda: parent[0])
    async with emulator(link, trace=trace, exit_with_parent=True) as robot:
        with Host(robot) as host:

            def drives() -> bool:
                host.send(Drive(0, 300, 0))
                return rows(trace) != [] and rows(trace)[-1]["v_m_s"] >= 0.25

            await host.until(drives, "driving")
        parent[0], killed_s = 1, robot.clock.now_s
        await asyncio.wait_for(robot.task, TIMEOUT_S)
    assert not link.is_symlink()
    seen = rows(trace)
    tripped = next(row for row in seen if int(row["flags"]) & Flags.DEADMAN and row["host_s"] > killed_s)
    after = [row for row in seen if row["t_s"] > tripped["t_s"] + 0.3]
    assert {row["v_m_s"] for row in after} == {0.0}
    assert {int(row["flags"]) for row in after} == {int(Flags.DEADMAN)}
    # The parent is looked for in the turn after its end, and the last row is written before the turn that ends it.
    assert seen[-1]["host_s"] - killed_s == pytest.approx(LINGER_S, abs=3 * TICK_S)


# The port and the clock.


async def test_a_file_is_never_overwritten_and_an_unwritable_trace_is_reported(link: Path, tmp_path: Path) -> None:
    with pytest.raises(EmulatorError, match=r"nowhere.*choose another path"):
        async with emulator(link, trace=tmp_path / "nowhere" / "t.csv"):
            pass
    assert not link.is_symlink()
    link.write_text("precious")
    with pytest.raises(EmulatorError, match=f"{link} exists and is not a link"):
        async with emulator(link):
            pass
    assert link.read_text() == "precious"


async def test_without_a_link_it_names_the_pty(link: Path) -> None:
    async with emulator(None) as robot:
        assert robot.path.startswith("/dev/")
        assert not link.exists()
        with Host(robot) as host:
            await host.until(lambda: len(host.of(Odom)) >= 1, "odometry")


async def test_a_wait_ends_when_the_host_has_written(link: Path) -> None:
    port = PtyPort(str(link))
    host = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.read() == b""
    wait = asyncio.create_task(wait_for_host(port, 10.0 * TIMEOUT_S))
    await asyncio.sleep(0.0)
    os.write(host, b"a word")
    await asyncio.wait_for(wait, TIMEOUT_S)
    assert port.read() == b"a word"
    os.close(host)
    port.close()


def test_the_emulators_clock_slips_rather_than_bursts() -> None:
    timeline = SlippingClock(100.0)
    strides = list(timeline.steps(100.035))
    assert strides == pytest.approx([0.01, 0.02, 0.03, 0.035])
    assert timeline.reading_at(0.035) == pytest.approx(100.035)
    assert list(timeline.steps(100.035)) == []
    assert list(timeline.steps(105.0))[-1] == pytest.approx(0.035 + LAG_MAX_S)
    assert timeline.slipped_s == pytest.approx(105.0 - 100.035 - LAG_MAX_S)
    assert timeline.reading_at(0.035 + LAG_MAX_S) == pytest.approx(105.0)
