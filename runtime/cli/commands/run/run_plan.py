"""What `echolocate run` was asked for, once its files are read and a robot is chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.settings import Settings
    from runtime.cli.commands.run.run_settings import SettingsFiles
    from runtime.support.length_format import Units
    from runtime.support.logs import LogStatus
    from runtime.support.restart import Restart
    from runtime.timing.run_clock import RunClock


@dataclass(frozen=True, slots=True)
class RunPlan:
    """A run's settings and options."""

    settings: Settings
    files: SettingsFiles
    """Where its settings are read again."""
    port: str | None
    """The robot's by the command line, None for that of the settings."""
    clock: RunClock
    log_status: LogStatus
    """Of its log."""
    restart: Restart
    """Is asked to start the run again."""
    units: Units
    """Of the operator console and of the tables."""
    emulated: bool
    """Whether the robot is emulated."""
    arm: bool
    """Whether a robot on a port is armed at the start."""
    seconds: float | None
    """How long the run lasts after recognition began; None: until it is ended."""
    foxglove: bool
    """Whether it is served to Foxglove."""
    record: str | None
    """The file it is recorded in, None for one in the folder of recordings."""
    no_record: bool
    """Whether it is not recorded."""

    @property
    def is_armed(self) -> bool:
        """Whether the robot is armed at the start."""
        return self.arm or self.emulated

    def reload(self) -> Settings:
        """Read the settings again."""
        return self.files.read_again(self.port, self.settings.link.port if self.emulated else None)

    def with_port(self, port: str) -> RunPlan:
        """Return the plan of the same run on the port of its emulator."""
        from runtime.cli.commands.run.run_settings import with_port

        return replace(self, settings=with_port(self.settings, port))
