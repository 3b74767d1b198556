"""A worker program that never opens its recording."""

from __future__ import annotations

import signal

if __name__ == "__main__":
    while True:
        signal.pause()
