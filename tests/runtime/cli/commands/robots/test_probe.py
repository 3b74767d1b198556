"""`echolocate probe`: what answers on a port, by emulated robots, and ports on which nothing does."""

from __future__ import annotations

import itertools
import os
import socketserver
import threading
import tty
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools.list_ports_common import ListPortInfo

from config.errors import DONE, FAILED
from drivers.arcos.codec import encode
from drivers.arcos.frames import RobotName
from drivers.heard_bytes import HeardBytes
from runtime.bridges import local_network
from runtime.bridges.local_network import Announced
from runtime.cli.app import run_command
from runtime.cli.commands.robots import port_probe
from runtime.cycle.connection import POLL_S
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.running import emulated
from tests.hil.truth import Truth


async def no_robots(_seconds: float) -> list[Announced]:
    return []


def test_runs_on_the_local_network_are_listed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def two(_seconds: float) -> list[Announced]:
        return [Announced("alpha", "DRIVE", "10.0.0.7", 8765, "1.2"), Announced("b", "?", "10.0.0.8", 80, "")]

    async def none(_seconds: float) -> list[Announced]:
        raise OSError("Network is unreachable")

    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.setattr(local_network, "find_robots", two)
    assert run_command(["probe"]) == DONE
    assert capsys.readouterr().out.splitlines()[:2] == [
        "on the local network:", "  alpha, DRIVE: http://10.0.0.7:8765/ (version 1.2)",
    ]  # fmt: skip
    monkeypatch.setattr(local_network, "find_robots", none)
    assert run_command(["probe"]) == FAILED
    assert "the local network cannot be searched: Network is unreachable" in capsys.readouterr().out


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("robot", "said"),
    [
        pytest.param("denning", "24 sensors; battery not reported; ", marks=pytest.mark.soak),
        ("p3at", "16 sensors; battery 12.6 V; "),
    ],
)
@stalls_excused
def test_a_robot_is_named_and_does_not_move(
    robot: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port_probe, "READY_MAX_S", TIMEOUT_S)
    capsys.readouterr()
    with emulated(tmp_path, "--robot", robot) as found:
        assert run_command(["probe", found.port]) == DONE
    port, text, command = capsys.readouterr().out.splitlines()
    assert port == f"{found.port}:"
    assert said in text
    assert "have heard something" in text
    assert command.strip() == f"run it: echolocate run --robot {robot} --port {found.port}"
    assert all(row.still for row in Truth(found.trace).read())


def test_a_port_that_says_nothing(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(port_probe, "ANSWER_MAX_S", 0.05)
    monkeypatch.setattr(local_network, "find_robots", no_robots)
    robot, line = os.openpty()
    tty.setraw(line)
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [ListPortInfo(os.ttyname(line))])
    assert run_command(["probe"]) == FAILED
    os.close(robot)
    os.close(line)
    assert capsys.readouterr().out.splitlines()[1:] == ["  nothing answers: is the robot on, and is this its cable?"]


def test_no_port_and_one_that_cannot_be_opened(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.setattr(local_network, "find_robots", no_robots)
    assert run_command(["probe"]) == FAILED
    assert "this computer has no serial port: plug the robot in" in capsys.readouterr().err
    assert run_command(["probe", str(tmp_path / "none")]) == FAILED
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2, "the same for every robot, so it is said once"
    assert "none" in lines[1]


class Exchange:
    """What went over one connection, bytes."""

    def __init__(self) -> None:
        self.asked = self.taken = self.answered = self.heard = 0

    @property
    def is_whole(self) -> bool:
        """Whether nothing is on its way."""
        return self.asked == self.taken and self.answered == self.heard


class Exchanges:
    """The connections to a device, and a clock that stands while anything is on its way, however long that takes."""

    def __init__(self) -> None:
        self.all: list[Exchange] = []
        self.numbers = itertools.count()
        self.now_s = 0.0

    def clock(self) -> float:
        if all(exchange.is_whole for exchange in self.all[-1:]):
            self.now_s += POLL_S
        return self.now_s

    def counted(self) -> HeardBytes:
        self.all.append(Exchange())
        return CountedBytes(self.all[-1])


class CountedBytes(HeardBytes):
    """The probe's end of a connection."""

    def __init__(self, exchange: Exchange) -> None:
        super().__init__()
        self._exchange = exchange

    def sent(self, data: bytes) -> None:
        self._exchange.asked += len(data)
        super().sent(data)

    def received(self, data: bytes) -> None:
        self._exchange.heard += len(data)
        super().received(data)


class Server(socketserver.ThreadingTCPServer):
    """Serves a device."""

    exchanges: Exchanges


class Peer(socketserver.BaseRequestHandler):
    """A device on the network that is no robot."""

    server: Server
    ends = False
    """Whether it ends the connection after its first answer."""

    def handle(self) -> None:
        exchanges = self.server.exchanges
        exchange = exchanges.all[next(exchanges.numbers)]
        while data := self.request.recv(4096):
            answer = self.answer(data)
            exchange.answered += len(answer)
            exchange.taken += len(data)
            self.request.sendall(answer)
            if self.ends:
                return

    def answer(self, data: bytes) -> bytes:
        raise NotImplementedError


class Talker(Peer):
    def answer(self, _data: bytes) -> bytes:
        return b"220 print server ready\r\n"


class WebServer(Talker):
    ends = True


class Full(WebServer):
    def answer(self, _data: bytes) -> bytes:
        return b""


class Mirror(Peer):
    def answer(self, data: bytes) -> bytes:
        return data


class OnlySync0(Peer):
    def answer(self, data: bytes) -> bytes:
        return data if data == bytes.fromhex("fafb03000000") else b""


class NamesItself(Peer):
    """A simulator of a p3dx that answers the SYNCs and nothing else."""

    def answer(self, data: bytes) -> bytes:
        if data == bytes.fromhex("fafb03020002"):
            return encode(RobotName("sim", "Pioneer", "p3dx"))
        return data if data in {bytes.fromhex("fafb03000000"), bytes.fromhex("fafb03010001")} else b""


@pytest.mark.parametrize(
    ("peer", "robot", "said"),
    [
        (Talker, None, "a device sends text, as '220 print server ready'"),
        (Talker, "p3dx", "a device sends text, as '220 print server ready'"),
        (WebServer, "p3dx", "a device sends text, as '220 print server ready'"),
        (Full, "denning", "its other end ends the connection before a robot answers"),
        (Mirror, "denning", "what this program sends comes back"),
        (OnlySync0, "p3dx", "as p3dx: the robot answers SYNC0 and not SYNC1"),
        (OnlySync0, None, "as amigo: the robot answers SYNC0 and not SYNC1"),
        (NamesItself, None, "as p3dx: the robot answers the SYNCs, but neither OPEN nor CONFIG"),
    ],
)
def test_a_device_that_is_no_robot_is_named_and_a_socket_has_no_speeds(
    peer: type[Peer], robot: str | None, said: str,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    exchanges = Exchanges()
    monkeypatch.setattr(port_probe, "ANSWER_MAX_S", 0.5)  # by their clock
    monkeypatch.setattr(port_probe, "HeardBytes", exchanges.counted)
    monkeypatch.setattr(port_probe, "time", SimpleNamespace(monotonic=exchanges.clock))
    with Server(("127.0.0.1", 0), peer) as server:
        server.exchanges = exchanges
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        named = () if robot is None else ("--robot", robot)
        assert run_command(["probe", f"socket://127.0.0.1:{server.server_address[1]}", *named]) == FAILED
        server.shutdown()
    out = capsys.readouterr().out
    assert said in " ".join(out.split())
    assert "baud" not in out
