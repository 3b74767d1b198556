"""Authentication refuses what another page, a rebound name or a guessed token would send."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.console.http.auth import Auth, new_token

AUTH = Auth("right", ("127.0.0.1",), 8765)


def test_a_token_has_128_bits_and_is_new_each_time() -> None:
    tokens = {new_token() for _ in range(200)}
    assert len(tokens) == 200
    assert all(len(token) == 22 for token in tokens)


@given(st.text())
def test_only_the_token_is_accepted(text: str) -> None:
    assert AUTH.accepts(text) == (text == "right")
    assert not AUTH.accepts(f"right{text}x")


def test_its_text_form_does_not_show_its_token() -> None:
    assert "right" not in repr(AUTH)


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost:8765"])
def test_its_own_names_are_accepted(host: str) -> None:
    assert AUTH.host_error(host, "127.0.0.1") is None
    assert AUTH.origin_error(f"http://{host}", host) is None


@pytest.mark.parametrize(
    "host", [None, "", "127.0.0.1", "127.0.0.1:80", "evil.example:8765", "localhost.evil.example:8765", "x" * 10_000]
)
def test_other_hosts_are_refused(host: str | None) -> None:
    problem = AUTH.host_error(host, "127.0.0.1")
    assert problem is not None
    assert len(problem) < 200


@pytest.mark.parametrize(
    "origin", [None, "", "null", "http://evil.example", "https://127.0.0.1:8765", "http://127.0.0.1:9999",
               "http://127.0.0.1:8765/", "http://localhost:8765"]
)  # fmt: skip
def test_other_origins_are_refused(origin: str | None) -> None:
    assert AUTH.origin_error(origin, "127.0.0.1:8765") is not None


def test_the_default_port_may_be_left_out() -> None:
    auth = Auth("right", ("robot",), 80)
    assert auth.host_error("robot", "10.0.0.7") is None
    assert auth.host_error("10.0.0.7:80", "10.0.0.7") is None
    assert auth.host_error("evil.example", "10.0.0.7") is not None


def test_the_address_of_the_request_is_a_valid_host() -> None:
    auth = Auth("right", ("robot", "robot.local"), 8765)
    assert auth.host_error("10.0.0.7:8765", "10.0.0.7") is None
    assert auth.host_error("robot.local:8765", "10.0.0.7") is None
    assert auth.host_error("[fe80::1]:8765", "fe80::1") is None
    assert auth.host_error("10.0.0.8:8765", "10.0.0.7") is not None
    assert auth.host_error("localhost:8765", "10.0.0.7") is not None
