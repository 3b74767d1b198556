"""Limits on a rate: a burst, then the rate; what is left out is counted."""

from __future__ import annotations

from drivers.token_bucket import LineLimit, TokenBucket


def test_a_bucket_allows_a_burst_and_then_its_rate() -> None:
    bucket = TokenBucket(rate_per_s=2.0, burst=3.0)
    assert [bucket.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(0.5) for _ in range(2)] == [True, False]
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False], "it holds no more than its burst"


def test_a_clock_that_goes_backward_adds_nothing() -> None:
    bucket = TokenBucket(rate_per_s=1.0, burst=1.0)
    assert bucket.take(10.0)
    assert not bucket.take(5.0)


def test_several_tokens_are_taken_together_or_not_at_all() -> None:
    bucket = TokenBucket(rate_per_s=10.0, burst=100.0)
    assert [bucket.take(0.0, count) for count in (60, 60, 40, 1)] == [True, False, True, False]
    assert bucket.take(1.0, 10)


def test_lines_left_out_are_counted_in_the_next_one() -> None:
    limit = LineLimit(rate_per_s=1.0, burst=2.0)
    assert [limit.take(0.0) for _ in range(5)] == [0, 0, None, None, None]
    assert [limit.take(s) for s in (1.0, 2.0)] == [3, 0]
