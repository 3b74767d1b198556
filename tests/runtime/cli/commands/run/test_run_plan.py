"""The plan of a run reads its settings again with the port that it runs on."""

from __future__ import annotations

import pytest

from runtime.cli.commands.run.run_plan import RunPlan
from runtime.cli.commands.run.run_settings import SettingsFiles
from runtime.support.logs import LogStatus
from runtime.support.restart import Restart
from runtime.timing.run_clock import RunClock


def plan(*, emulated: bool, port: str | None) -> RunPlan:
    files = SettingsFiles("office")
    return RunPlan(
        settings=files.read_unchecked(),
        files=files,
        port=port,
        clock=RunClock(),
        log_status=LogStatus(),
        restart=Restart(None),
        units="m",
        emulated=emulated,
        arm=False,
        seconds=None,
        foxglove=False,
        record=None,
        no_record=True,
    )


@pytest.mark.parametrize(("emulated", "port"), [(True, None), (False, "/dev/ttyUSB7")])
def test_settings_read_again_keep_the_port(emulated: bool, port: str | None) -> None:
    running = plan(emulated=emulated, port=port).with_port("/dev/pts/5" if emulated else "/dev/ttyUSB7")
    assert running.reload().link.port == running.settings.link.port
