"""The parts of a cycle by name, so that the step can say where it is and the books can say what took the time."""

from __future__ import annotations

from enum import Enum


class Phase(Enum):
    """A part of the cycle, in the order in which they follow each other."""

    GATHER = "gather"
    """Drain the link."""
    PERCEIVE = "perceive"
    """The part of perception that always runs."""
    DECIDE = "decide"
    """Modes, schemas, arbiter."""
    COMMAND = "command"
    """Put the command on the line."""
    REFINE = "refine"
    """Perception's refinement, within its budget."""
    OBSERVERS = "observers"
    """View and recorder."""


def unmarked(_phase: Phase) -> None:
    """Mark nothing: for those who do not care what takes the time."""
