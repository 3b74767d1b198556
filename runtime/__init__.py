"""The running program: the perception-action cycle, its modes, recordings, the console and the command line."""

VERSION = "0.1.0"
