"""Tests of the picture of a run on a terminal: what it shows at which size."""

from __future__ import annotations

import io
import math
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from config.load import load_settings
from drivers.messages import Pose
from perception.detected_object import DetectedObject, MapCounts
from perception.localization.localized_pose import LocalizedPose
from runtime.cli.terminal.page_text import localized_place
from runtime.cli.terminal.picture import CORNERED_M, Picture, Scale, Snapshot
from runtime.support.child_process import INTERPRETER, child_environment

SETTINGS = load_settings("hallway")
EMPTY = Snapshot(
    "CONNECTING", None, None, [], [], MapCounts(0, 0, 0), (), [math.nan] * 24, (0, 0, 0), 0, 0,
    {"p50": 0.0, "p99": 0.0, "max": 0.0}, {"p50": 0.0, "p99": 0.0, "max": 0.0},
)  # fmt: skip


def seen(x: float, y: float, model: str = "semicircle") -> DetectedObject:
    return DetectedObject(model, x, y, 0.5, 0.01, 39, 0.9)


def printed(snapshot: Snapshot, width: int = 100, height: int = 50, url: str | None = None) -> str:
    console = Console(record=True, width=width, height=height, file=io.StringIO(), color_system=None)
    radii_m = {model.name: model.arc_radius_m or CORNERED_M for model in SETTINGS.models}
    picture = Picture(console, Scale("ft", SETTINGS.ring.range_max_m, radii_m, radii_m))
    console.print(picture.draw(replace(snapshot, console_url=url)))
    return console.export_text()


@pytest.mark.parametrize("width", [1, 2, 20, 30, 80, 250])
def test_before_the_first_odometry_there_is_a_picture(width: int) -> None:
    text = printed(EMPTY, width)
    assert "CONNECTING" in text or width < 20
    if width >= 80:
        assert "waiting for odometry" in text
        assert "0 frames, 0 bad, 0 lost" in text
        assert "·" * 24 in text


def test_a_picture_shows_mode_reason_objects_ring_and_numbers() -> None:
    snapshot = replace(
        EMPTY,
        mode="SAFE_STOP", reason="bumper contact: free the robot, then re-arm",
        pose=(1.0, 0.0, 0.0), trail=[(0.0, 0.0)], segments=[(1.0, 1.0)],
        map_counts=MapCounts(1, 1, 7, 12, 3),
        objects=(seen(0.3048, 1.2192),),
        ranges=[math.nan, math.inf, 0.0, SETTINGS.ring.range_max_m, *[1.0] * 20],
        line=(1832, 3, 2), cycles=520, late=9,
        cycle_us={"p50": 478.0, "p99": 2961.0, "max": 5958.0}, lag_us={"p50": 907.0, "p99": 5415.0, "max": 8954.0},
        missed=4, faults=(("refine", 2), ("outside the process", 7)),
    )  # fmt: skip
    text = printed(snapshot)
    for piece in (
        "SAFE STOP", "bumper contact: free the robot", "→", "•",
        "1 segments, 7 hypotheses, 12 objects left behind; 3 near objects wait for room",
        "1832 frames, 3 bad, 2 lost",
        "520, 9 late, 4 missed", "outside the process: 7, refine: 2",
        "0.48 ms (p99 2.96)", "0.91 ms (p99 5.42)", "semicircle", "1.00", "4.00", "··█▁",
    ):  # fmt: skip
        assert piece in text, piece


URL = "http://127.0.0.1:8374/?token=qT3xYw0s1uBhVJYkz0cH4nR2mFpL8dXe"
BUSY = replace(
    EMPTY,
    mode="SAFE_STOP", reason="no echoes for 0.6 s: check the ring's power and cable; then re-arm",
    pose=(1.0, 0.0, 0.0), trail=[(0.1 * k, 0.0) for k in range(40)],
    segments=[(1.0, 1.0 + 0.05 * k) for k in range(30)], map_counts=MapCounts(304, 9, 7),
    objects=(
        DetectedObject("semicircle", -1.005, 1.2192, 0.5, 0.0123, 39, 0.999, 0.999, number=3),
        DetectedObject("wall", 3.0, 2.0, 0.0, 0.9, 50, 0.97, 0.97, (3.0, 0.0, 0.0), 12, sigma_theta=0.01),
        *(DetectedObject("post", 0.2 * k, 3.0, 0.0, 0.02, 12, 0.8, 0.8, number=20 + k) for k in range(14)),
    ),
    sensors=("sensor 4 has been silent for 30 s", "sensor 9 repeats 0.91 m"), line=(1832, 3, 2),
    cycles=520, late=9, faults=(("refine", 2),), twist=(-0.2, -0.1),
)  # fmt: skip


@pytest.mark.promise("P31")
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 60), (40, 16), (100, 10)])
def test_what_a_person_needs_fits_the_terminal(size: tuple[int, int]) -> None:
    width, height = size
    lines = printed(BUSY, width, height, URL).rstrip("\n").split("\n")
    assert len(lines) < height, "nothing scrolls away"
    assert max(map(len, lines)) <= width
    assert lines[0].startswith(" SAFE STOP  −0.66 ft/s ↻ 6°/s")
    assert "no ech" in f"{lines[0]}{lines[1]}"
    assert URL in "".join(line.rstrip() for line in lines)
    assert any("space halt" in line or "␣ halt" in line for line in lines)
    assert sum(line.startswith("masked") for line in lines) == 2
    assert "check the ring's power and cable; then re-arm" in " ".join(map(str.strip, lines[:4])), "with the action"
    if height > 10:
        assert any("3 semicircle" in line and "> 99 %" in line for line in lines)
    if height >= 24:
        assert any("20 post" in line and "hidden" in line for line in lines), "the wall is between"
        text = "\n".join(lines)
        for piece in (
            "objects  15, and 1 wall", "−3.30, 4.00 ft, 29°  ", "± 0.040 ft", "0.00, 6.56 to 19.69, 6.56 ft",
            "19.69 ft long", "1832 frames, 3 bad, 2 lost", "304 segments", "refine: 2",
        ):  # fmt: skip
            assert piece in text, piece
        assert ("→" in text) == (height > 24 or "have no room" not in text)


@pytest.mark.parametrize("width", range(22, 80, 3))
def test_no_number_is_cut(width: int) -> None:
    whole = {piece for line in printed(BUSY, 250, 60, URL).split("\n") for piece in line.split()}
    for line in printed(BUSY, width, 60, URL).split("\n"):
        cut, ellipsis, _ = line.partition("…")
        last = cut.split()[-1:] if ellipsis and not cut.endswith(" ") else []
        assert all(piece in whole or not any(map(str.isdigit, piece)) for piece in last), line


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (20, 5), (5, 20), (80, 2)])
def test_no_size_is_too_small(size: tuple[int, int]) -> None:
    width, height = size
    text = printed(BUSY, width, height, URL).rstrip("\n")
    assert len(text.split("\n")) <= max(1, height - 1)
    if size == (20, 5):
        assert text.startswith(" SAFE STOP")


def test_the_place_in_the_map_is_shown_and_that_it_is_unknown() -> None:
    assert "place" not in printed(EMPTY)
    unknown = LocalizedPose(Pose(0.0, 0.0, 0.0), 0.0, np.diag([np.inf] * 3), "lost", 0.02)
    assert "unknown, lost 2 %" in printed(replace(EMPTY, place=localized_place(unknown, "ft")))
    known = LocalizedPose(Pose(3.048, 0.3048, np.pi), 0.0, np.diag([4e-4, 1e-4, 1e-4]), "tracking", 0.97)
    assert "10.00, 1.00 ± 0.066 ft, 180° ± 0.6°, tracking 97 %" in printed(
        replace(EMPTY, place=localized_place(known, "ft"))
    )


def test_the_process_that_draws_imports_nothing_that_takes_long() -> None:
    """It starts with the run: with numpy, pydantic and numba it took half a second of processor time from it."""
    program = "import sys, runtime.cli.terminal.__main__; print(*sorted(m for m in sys.modules if '.' not in m))"
    done = subprocess.run(
        [*INTERPRETER, "-c", program],
        env=child_environment(),
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    )
    slow = {"numpy", "pydantic", "numba", "asyncio", "drivers", "aiohttp", "structlog", "cyclopts"}
    assert not slow & set(done.stdout.split())
