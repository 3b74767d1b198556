"""Rows of a pipe are converted as they come, by the conventions that its first rows show."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from runtime.recording.conventions.options import RingLogOptions
from runtime.recording.conventions.reading import FIRST_OF_PIPE, converted_firings, open_ring_log
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import Convention, make_drive, written
from tests.runtime.recording.conventions.test_reading import check_right


def test_a_pipe_gives_its_first_firing_after_some_hundred_rows(tmp_path: Path) -> None:
    drive = make_drive(3, "p3dx", "room", "specular")
    table = written(drive, Convention(heading="cw"), np.random.default_rng(3), tmp_path / "table.csv")
    lines = table.read_bytes().splitlines(keepends=True)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    is_read = Event()

    def write() -> None:
        with pipe.open("wb") as file:
            file.writelines(lines[: FIRST_OF_PIPE + 50])
            file.flush()
            is_read.wait(60.0)
            file.writelines(lines[FIRST_OF_PIPE + 50 :])

    writer = Thread(target=write)
    writer.start()
    firings = open_ring_log(pipe, drive.settings, RingLogOptions(heading="cw"))
    got = [next(firings)]
    is_read.set()
    got += firings
    writer.join()
    check_right(got, drive, Convention(heading="cw"))


def test_a_pipe_whose_later_rows_show_other_conventions_is_refused() -> None:
    drive = make_drive(3, "p3dx", "room", "specular")
    rows = [
        Firing(float(t), Pose(x, y, -theta), -yaw, ranges)
        for t, (x, y, theta, yaw), ranges in zip(drive.t, drive.pose, drive.ranges, strict=True)
    ]
    first, said = 30, list[str]()
    still = [replace(rows[0], ranges_m=row.ranges_m) for row in rows[:first]]
    firings = converted_firings(
        [*still, *rows], Path("pipe"), drive.settings, RingLogOptions(), said.append, first=first
    )
    with pytest.raises(RingLogError, match=r"--heading cw|--length-unit m "):
        list(firings)
