"""One client has control: it is requested, granted, kept, and lost if it is not used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.console.clients.control import REQUEST_TIMEOUT_S, Control, Holder


@dataclass(eq=False)
class StubClient:
    number: int
    has_token: bool = True

    @property
    def name(self) -> str:
        return f"client {self.number}"


class Notified:
    """A control, and whom it notified."""

    def __init__(self) -> None:
        self.messages: list[tuple[int, int | None]] = []
        self.lost: list[int] = []
        self.control = Control(self._notify, lambda client: self.lost.append(client.number))

    def _notify(self, client: Holder, requester: Holder | None) -> None:
        self.messages.append((client.number, None if requester is None else requester.number))


@pytest.fixture
def case() -> tuple[Notified, Control, StubClient, StubClient]:
    notified, first, second = Notified(), StubClient(1), StubClient(2)
    notified.control.join(first)
    notified.control.join(second)
    return notified, notified.control, first, second


Case = tuple[Notified, Control, StubClient, StubClient]


def test_the_first_client_has_control(case: Case) -> None:
    notified, control, first, second = case
    assert control.is_held_by(first)
    assert not control.is_held_by(second)
    assert notified.messages == []


def test_a_client_without_token_never_gets_control() -> None:
    control = Notified().control
    watcher = StubClient(1, has_token=False)
    control.join(watcher)
    assert not control.is_held_by(watcher)


def test_control_is_requested_and_granted(case: Case) -> None:
    notified, control, first, second = case
    reason = control.request(second, 0.0)
    assert reason is not None
    assert "client 1 has control" in reason
    assert control.is_held_by(first)
    assert notified.messages == [(1, 2)]
    assert control.grant(3) == "client 3 does not ask for control"
    assert control.grant(2) is None
    assert control.is_held_by(second)
    assert notified.messages[1:] == [(1, None), (2, None)]
    assert notified.lost == [1]


def test_a_holder_declines_by_requesting_control_again(case: Case) -> None:
    _, control, first, second = case
    control.request(second, 0.0)
    assert control.request(first, 1.0) is None
    control.expire(2.0 * REQUEST_TIMEOUT_S)
    assert control.is_held_by(first)


def test_an_idle_holder_loses_control_after_a_request(case: Case) -> None:
    _, control, first, second = case
    control.expire(1e9)
    assert control.is_held_by(first), "no client has asked"
    control.request(second, 0.0)
    control.note_use(first, REQUEST_TIMEOUT_S - 1.0)
    control.note_use(second, REQUEST_TIMEOUT_S)
    control.expire(2.0 * REQUEST_TIMEOUT_S - 1.5)
    assert control.is_held_by(first)
    control.expire(2.0 * REQUEST_TIMEOUT_S - 1.0)
    assert control.is_held_by(second)


@pytest.mark.promise("P22")
def test_requests_of_others_and_repeated_ones_postpone_nothing(case: Case, measured: Callable[[str], None]) -> None:
    _, control, _first, second = case
    third = StubClient(3)
    control.join(third)
    for k in range(100):
        host_s = 0.01 * k * REQUEST_TIMEOUT_S
        assert "client 1 has control and was asked" in str(control.request(second, host_s))
        assert control.request(third, host_s) == "client 1 has control, and client 2 has asked for it already"
        control.expire(host_s)
    assert "you get it in 0 s" in str(control.request(second, REQUEST_TIMEOUT_S - 0.1))
    control.expire(REQUEST_TIMEOUT_S)
    assert control.is_held_by(second)
    control.request(third, REQUEST_TIMEOUT_S)
    control.leave(third)
    control.expire(1e9)
    assert control.is_held_by(second), "the one that asked has left"
    measured("200 requests of two clients for control that is not used: it passes to the first of them after 10 s")


def test_released_or_lost_control_passes_to_the_requester(case: Case) -> None:
    notified, control, first, second = case
    control.release()
    assert not control.is_held_by(first)
    assert not control.is_held_by(second)
    assert control.request(first, 0.0) is None
    control.request(second, 0.0)
    control.leave(first)
    assert control.is_held_by(second)
    assert notified.lost == [1, 1]
    control.leave(second)
    assert not control.is_held_by(second)


@given(st.lists(st.tuples(st.sampled_from(["join", "leave", "request", "release", "grant", "use", "expire"]),
                          st.integers(0, 3), st.floats(0.0, 100.0))))  # fmt: skip
def test_at_most_one_client_has_control(steps: list[tuple[str, int, float]]) -> None:
    control = Notified().control
    clients = [StubClient(n, has_token=n != 3) for n in range(4)]
    connected: set[int] = set()
    for action, number, host_s in steps:
        client = clients[number]
        if action == "join":
            connected.add(number)
            control.join(client)
        elif number in connected:
            match action:
                case "leave":
                    connected.remove(number)
                    control.leave(client)
                case "request" if client.has_token:
                    control.request(client, host_s)
                case "release" if control.is_held_by(client):
                    control.release()
                case "grant" if control.is_held_by(client):
                    control.grant(int(host_s) % 4)
                case "use":
                    control.note_use(client, host_s)
                case "expire":
                    control.expire(host_s)
        holders = [n for n in range(4) if control.is_held_by(clients[n])]
        assert len(holders) <= 1
        assert set(holders) <= connected - {3}
