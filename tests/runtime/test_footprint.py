"""What a run costs its machine, held against what this very process can be made to cost."""

from __future__ import annotations

import time

import numpy as np
import pytest

from runtime.footprint import Footprint, age_s, own_mb, peak_mb, rss_mb
from runtime.memory import MemoryPolicy


def test_memory_that_is_filled_is_seen() -> None:
    books = Footprint(MemoryPolicy())
    block = np.full(8_000_000, 1.0)
    row = books.close()
    growth_mb, rss, peak = row["growth_mb"], row["rss_mb"], row["rss_peak_mb"]
    assert growth_mb is not None
    assert rss is not None
    assert peak is not None
    assert 50.0 < growth_mb < 100.0
    assert rss > 0.0
    assert peak >= growth_mb
    assert block[0] == 1.0


def test_processor_time_is_a_share_of_the_wall_clock() -> None:
    """Not asserted is how large the share of a busy loop is: others may run on this machine."""
    books = Footprint(MemoryPolicy())
    end_cpu_s = time.process_time() + 0.05
    while time.process_time() < end_cpu_s:
        pass
    row = books.close()
    assert row["cpu_share"] > 0.0
    assert row["compilations"] == 0
    assert row["collections"] == [0, 0, 0]


def test_its_age_grows_with_the_clock() -> None:
    before, begin_s = age_s(), time.monotonic()
    assert before is not None
    while time.monotonic() < begin_s + 0.02:
        pass
    after = age_s()
    assert after is not None
    assert after - before >= 0.02 - 1e-3
    assert before > 0.0


def test_a_system_that_tells_nothing_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_named: object) -> str:
        raise FileNotFoundError(2, "no such file")

    monkeypatch.setattr("runtime.footprint.Path.read_text", refuse)
    assert (age_s(), rss_mb(), own_mb(), peak_mb()) == (None, None, None, None)
    row = Footprint(MemoryPolicy()).close()
    assert (row["start_s"], row["rss_mb"], row["growth_mb"]) == (None, None, None)
