"""The parts of a cycle by name, for the step to report and the timing monitor to measure."""

from __future__ import annotations

from enum import StrEnum


class Phase(StrEnum):
    """A part of the cycle, in the order in which they follow each other.

    A `StrEnum`, because its hash is that of a text; a plain Enum computes its own in Python.
    """

    GATHER = "gather"
    """Take what arrived on the line."""
    PERCEIVE = "perceive"
    """The part of perception that always runs."""
    DECIDE = "decide"
    """Modes, schemas, arbiter."""
    COMMAND = "command"
    """Send the command."""
    REFINE = "refine"
    """Perception's refinement, within its budget."""
    OBSERVERS = "observers"
    """View and recorder."""


def ignore_phase(_phase: Phase) -> None:
    """Do nothing at the end of a phase: for callers that measure nothing."""
