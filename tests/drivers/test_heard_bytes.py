"""What is said about the bytes of a device that is no robot."""

from __future__ import annotations

import random

import pytest

from drivers.heard_bytes import HeardBytes


def heard(*chunks: bytes) -> HeardBytes:
    bytes_ = HeardBytes()
    for chunk in chunks:
        bytes_.received(chunk)
    return bytes_


def test_text_is_quoted_safely_and_cut() -> None:
    assert "as 'Ready'" in (heard(b"\r\n\r\n  Ready \r\n").stranger or "")
    long = heard(b"x" * 4000).stranger or ""
    assert "x" * 59 + "…'" in long
    assert "x" * 61 not in long
    hostile = heard(b"\x1b]0;owned\x07" + b"hello, I am text\r\n" * 9).stranger or ""
    assert hostile.isprintable()


@pytest.mark.parametrize("seed", range(50))
def test_neither_noise_nor_short_words_are_text(seed: int) -> None:
    assert heard(random.Random(seed).randbytes(512)).stranger is None
    assert heard(b"ok\r\n").stranger is None
    assert heard().stranger is None


@pytest.mark.parametrize(
    ("sent", "quoted"),
    [
        (b"23\r\n", "23"),
        (b"1.25\n", "1.25"),
        ("Gerät bereit: 20 °C ✓\r\n".encode(), "Gerät bereit: 20 °C ✓"),
        ("设备已准备好\n".encode(), "设备已准备好"),
    ],
)
def test_short_lines_and_other_alphabets_are_text_however_they_are_cut(sent: bytes, quoted: str) -> None:
    stream = sent * 40
    for begin in range(len(sent)):
        for end in range(len(stream) - len(sent), len(stream)):
            assert f"as '{quoted}'" in (heard(stream[begin:end]).stranger or "")


@pytest.mark.parametrize("seed", range(200))
def test_few_random_bytes_are_no_text(seed: int) -> None:
    rng = random.Random(seed)
    assert heard(rng.randbytes(rng.randrange(1, 64))).stranger is None


def test_what_was_found_out_outlasts_a_change_of_speed_but_not_another_line() -> None:
    bytes_ = heard(b"GPS ready\r\n")
    bytes_.begin_speed()
    bytes_.received(b"\xf3" * 30)
    assert "GPS ready" in (bytes_.stranger or "")
    bytes_.clear()
    assert bytes_.stranger is None
    assert bytes_.total == 0


def test_a_device_with_a_prompt_is_one_stranger_between_its_writes() -> None:
    """It prints, sends back what it gets, and prints again: what was found out does not change with each write."""
    bytes_, said = heard(b"\r\nboot of a board\r\nlogin: "), []
    for k in range(20):
        write = bytes([0xAA, 0x55, 1, k, 0, 0, 9, k])
        bytes_.sent(write)
        said.append(bytes_.stranger)
        bytes_.received(write)
        said.append(bytes_.stranger)
        bytes_.received(b"\r\nunknown command %d\r\nlogin: " % k * 8)
        said.append(bytes_.stranger)
    assert said[0] is not None
    assert "a device sends text" in said[0]
    assert set(said[1:]) == {said[1]}
    assert "what this program sends comes back" in (said[1] or "")


def test_the_first_text_is_quoted_from_the_second_write_on() -> None:
    bytes_ = HeardBytes()
    for k in range(5):
        bytes_.sent(bytes(8))
        bytes_.received(b"temperature %d degrees\r\n" % k)
    assert "temperature 0 degrees" in (bytes_.stranger or "")


def test_only_a_whole_write_that_comes_back_is_an_echo() -> None:
    bytes_ = HeardBytes()
    bytes_.sent(b"\xfa\xfb\x03\x1d\x00\x1d\xfa\xfb\x03\x37\x00\x37")
    bytes_.received(b"\xfa\xfb\x03\x1d\x00\x1d")
    assert bytes_.stranger is None, "one simulator takes it for a SYNC"
    bytes_.received(b"\xfa\xfb\x03\x37\x00\x37")
    assert "what this program sends comes back" in (bytes_.stranger or "")
