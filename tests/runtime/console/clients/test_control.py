"""One client has the control; it is asked for, handed over, kept, and lost where nobody uses it."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.console.clients.control import REQUEST_TIMEOUT_S, Control, Holder


@dataclass(eq=False)
class Somebody:
    number: int
    has_token: bool = True

    @property
    def name(self) -> str:
        return f"client {self.number}"


class Controlled:
    """A control and what it told."""

    def __init__(self) -> None:
        self.told: list[tuple[int, int | None]] = []
        self.left: list[int] = []
        self.control = Control(self._tell, lambda client: self.left.append(client.number))

    def _tell(self, client: Holder, asker: Holder | None) -> None:
        self.told.append((client.number, None if asker is None else asker.number))


@pytest.fixture
def case() -> tuple[Controlled, Control, Somebody, Somebody]:
    controlled, first, second = Controlled(), Somebody(1), Somebody(2)
    controlled.control.join(first)
    controlled.control.join(second)
    return controlled, controlled.control, first, second


Case = tuple[Controlled, Control, Somebody, Somebody]


def test_the_first_has_it(case: Case) -> None:
    controlled, control, first, second = case
    assert control.is_held_by(first)
    assert not control.is_held_by(second)
    assert controlled.told == []


def test_who_may_only_watch_never_has_it() -> None:
    control = Controlled().control
    watcher = Somebody(1, has_token=False)
    control.join(watcher)
    assert not control.is_held_by(watcher)


def test_it_is_asked_for_and_granted(case: Case) -> None:
    controlled, control, first, second = case
    validate = control.request(second, 0.0)
    assert validate is not None
    assert "client 1 has control" in validate
    assert control.is_held_by(first)
    assert controlled.told == [(1, 2)]
    assert control.grant(3) == "client 3 does not ask for control"
    assert control.grant(2) is None
    assert control.is_held_by(second)
    assert controlled.told[1:] == [(1, None), (2, None)]
    assert controlled.left == [1]


def test_it_is_kept_by_who_takes_it_again(case: Case) -> None:
    _, control, first, second = case
    control.request(second, 0.0)
    assert control.request(first, 1.0) is None
    control.expire(2.0 * REQUEST_TIMEOUT_S)
    assert control.is_held_by(first)


def test_who_is_idle_loses_it_once_asked(case: Case) -> None:
    _, control, first, second = case
    control.expire(1e9)
    assert control.is_held_by(first), "nobody has asked"
    control.request(second, 0.0)
    control.note_use(first, REQUEST_TIMEOUT_S - 1.0)
    control.note_use(second, REQUEST_TIMEOUT_S)
    control.expire(2.0 * REQUEST_TIMEOUT_S - 1.5)
    assert control.is_held_by(first)
    control.expire(2.0 * REQUEST_TIMEOUT_S - 1.0)
    assert control.is_held_by(second)


def test_it_goes_to_who_asked_when_it_is_given_up_or_lost(case: Case) -> None:
    controlled, control, first, second = case
    control.release()
    assert not control.is_held_by(first)
    assert not control.is_held_by(second)
    assert control.request(first, 0.0) is None
    control.request(second, 0.0)
    control.leave(first)
    assert control.is_held_by(second)
    assert controlled.left == [1, 1]
    control.leave(second)
    assert not control.is_held_by(second)


@given(st.lists(st.tuples(st.sampled_from(["join", "leave", "take", "give", "grant", "used", "expire"]),
                          st.integers(0, 3), st.floats(0.0, 100.0))))  # fmt: skip
def test_never_two(steps: list[tuple[str, int, float]]) -> None:
    control = Controlled().control
    people = [Somebody(n, has_token=n != 3) for n in range(4)]
    there: set[int] = set()
    for what, who, now_s in steps:
        one = people[who]
        if what == "join":
            there.add(who)
            control.join(one)
        elif who in there:
            match what:
                case "leave":
                    there.remove(who)
                    control.leave(one)
                case "take" if one.has_token:
                    control.request(one, now_s)
                case "give" if control.is_held_by(one):
                    control.release()
                case "grant" if control.is_held_by(one):
                    control.grant(int(now_s) % 4)
                case "used":
                    control.note_use(one, now_s)
                case "expire":
                    control.expire(now_s)
        holders = [n for n in range(4) if control.is_held_by(people[n])]
        assert len(holders) <= 1
        assert set(holders) <= there - {3}
