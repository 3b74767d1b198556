"""Options of the commands on finished runs: the file, and what it may not contain itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from runtime.recording.conventions.options import AUTO, RingLogOptions

if TYPE_CHECKING:
    from runtime.analysis.timeline_sources import TimelineSource

LogOptions = Annotated[RingLogOptions, Parameter(name="*", negative="", show_default=False)]
File = Annotated[str, Parameter(help="Recording (MCAP) or ring log (CSV).")]


@Parameter(name="*")
@dataclass(frozen=True)
class SourceOptions:
    """What a file may not contain itself: its world, and for ring logs the robot and the models."""

    world: Annotated[
        str | None, Parameter(help="World file, or the name of a shipped one, if FILE does not contain its world.")
    ] = None
    robot: Annotated[str | None, Parameter(help="Ring logs: robot file, or the name of a shipped one.")] = None
    models: Annotated[
        tuple[str, ...],
        Parameter(
            name="--model",
            negative="",
            show_default=False,
            help="Ring logs: object model, file or name of a shipped one; may be repeated.",
        ),
    ] = ()
    log: LogOptions = AUTO

    def timeline_source(self, file: str, sets: tuple[str, ...]) -> TimelineSource:
        """Return the file together with these options, as the analysis takes them."""
        from runtime.analysis.timeline_sources import TimelineSource

        return TimelineSource(file, sets, self.robot, self.models, self.world, self.log)


NO_OPTIONS: Final = SourceOptions()
