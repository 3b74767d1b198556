"""The running program: the perception-action cycle, its modes, recordings, the console and the command line."""

VERSION = "1.0.0"
