"""A limit on the rate of events: what a peer may cause, on average and in a burst."""

from __future__ import annotations


class TokenBucket:
    """Limits a rate of events: `rate_per_s` tokens come each second, and a bucket that starts full holds `burst`."""

    def __init__(self, rate_per_s: float, burst: float) -> None:
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._tokens = burst
        self._updated_s: float | None = None

    def take(self, now_s: float, count: float = 1.0) -> bool:
        """Take tokens and return True; return False if so many are not left.

        A clock that goes backward adds nothing.
        """
        if self._updated_s is not None:
            added = self._rate_per_s * max(0.0, now_s - self._updated_s)
            self._tokens = min(self._burst, self._tokens + added)
        self._updated_s = now_s
        if self._tokens < count:
            return False
        self._tokens -= count
        return True


class LineLimit:
    """Limits the lines of one kind in the log, and counts those that are left out."""

    def __init__(self, rate_per_s: float, burst: float) -> None:
        self._bucket = TokenBucket(rate_per_s, burst)
        self.suppressed = 0
        """Number of lines left out since the last one."""

    def take(self, now_s: float) -> int | None:
        """Return how many lines were left out before this one, and forget them; None if this one is left out, too."""
        if not self._bucket.take(now_s):
            self.suppressed += 1
            return None
        suppressed, self.suppressed = self.suppressed, 0
        return suppressed
