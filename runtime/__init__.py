"""The running program: the perception-action cycle, its modes, recordings, the console and the command line."""

from typing import Final

VERSION: Final = "0.1.0"
