"""Who is let in: what a browser on another page, a rebound name or a guess of the token would send is not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.console.http.auth import Auth, new_token

GUARD = Auth("right", ("127.0.0.1",), 8765)


def test_a_token_has_128_bits_and_is_new_each_time() -> None:
    tokens = {new_token() for _ in range(200)}
    assert len(tokens) == 200
    assert all(len(token) == 22 for token in tokens)


@given(st.text())
def test_only_the_token_is_the_token(text: str) -> None:
    assert GUARD.accepts(text) == (text == "right")
    assert not GUARD.accepts(f"right{text}x")


def test_the_guard_does_not_show_its_token() -> None:
    assert "right" not in repr(GUARD)


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost:8765"])
def test_its_own_names(host: str) -> None:
    assert GUARD.host_error(host, "127.0.0.1") is None
    assert GUARD.origin_error(f"http://{host}", host) is None


@pytest.mark.parametrize(
    "host", [None, "", "127.0.0.1", "127.0.0.1:80", "evil.example:8765", "localhost.evil.example:8765", "x" * 10_000]
)
def test_names_that_are_not_its_own(host: str | None) -> None:
    trouble = GUARD.host_error(host, "127.0.0.1")
    assert trouble is not None
    assert len(trouble) < 200


@pytest.mark.parametrize(
    "origin", [None, "", "null", "http://evil.example", "https://127.0.0.1:8765", "http://127.0.0.1:9999",
               "http://127.0.0.1:8765/", "http://localhost:8765"]
)  # fmt: skip
def test_origins_that_are_not_its_own(origin: str | None) -> None:
    assert GUARD.origin_error(origin, "127.0.0.1:8765") is not None


def test_the_port_that_goes_without_saying() -> None:
    guard = Auth("right", ("robot",), 80)
    assert guard.host_error("robot", "10.0.0.7") is None
    assert guard.host_error("10.0.0.7:80", "10.0.0.7") is None
    assert guard.host_error("evil.example", "10.0.0.7") is not None


def test_beyond_this_machine_the_address_it_was_reached_at_is_its_name() -> None:
    guard = Auth("right", ("robot", "robot.local"), 8765)
    assert guard.host_error("10.0.0.7:8765", "10.0.0.7") is None
    assert guard.host_error("robot.local:8765", "10.0.0.7") is None
    assert guard.host_error("[fe80::1]:8765", "fe80::1") is None
    assert guard.host_error("10.0.0.8:8765", "10.0.0.7") is not None
    assert guard.host_error("localhost:8765", "10.0.0.7") is not None
