"""When, whether and wiring: the cycle, its modes, its records, and the command."""

from typing import Final

VERSION: Final = "0.1.0"
