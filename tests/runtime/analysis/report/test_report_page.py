"""Tests of the report page: self-contained, valid, small, and with the run's own numbers."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest

from config.model import ModelConfig
from config.world import PolygonConfig
from drivers.messages import Pose
from perception.detected_object import DetectedObject
from runtime.analysis.report import report_page
from runtime.analysis.report.report_page import run_page
from runtime.analysis.timeline import ModeEntry
from tests.runtime.analysis.report.page_reader import PageReader
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline, with_polyline

SIZE_MAX = 3_000_000
SPREAD = {"p50": 170.0, "p99": 1250.0, "p999": 8004.0, "max": 49_653.0}


@pytest.fixture(scope="module")
def shown() -> str:
    return run_page(synthetic_timeline(), "ft")


def test_page_is_self_contained(shown: str) -> None:
    reader = PageReader(shown)
    assert reader.open == []
    assert all(link.startswith("#") for link in reader.links), reader.links
    assert {link[1:] for link in reader.links} <= set(reader.ids)
    assert len(reader.ids) == len(set(reader.ids))
    assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", shown)
    assert "script" not in reader.tags
    assert set(re.findall(r"url\(#([^)]*)\)", shown)) <= set(reader.ids)
    assert len(shown.encode()) < SIZE_MAX


def test_page_shows_the_run(shown: str) -> None:
    text = " ".join(PageReader(shown).text)
    for title in ("Objects", "Figures", "Bookmarks", "Timing", "Link", "Modes and stop reasons", "Settings"):
        assert title in text
    assert shown.count("<svg") == 5
    drums = re.findall(r"<td>drum \d</td><td>\(([^)]*)\)</td>", shown)
    assert drums == ["1.00, 4.00", "4.00, 4.00", "7.00, 4.00", "1.00, -4.00", "4.00, -4.00", "7.00, -4.00"]
    errors = re.findall(r"\(-?[\d.]+, -?[\d.]+\)</td><td>([\d.]+)</td></tr>", shown)
    assert errors == ["0.033"] * 3
    named = re.findall(r"<td>(drum \d), drum</td>", shown)
    assert named == ["drum 1", "drum 2", "drum 3"], "each has its name of Table 2"
    assert text.count("not found") == 3
    assert "3 of 6" in text
    assert "as the paper's Figure 6" in text
    assert "0.249 ft" in text, "the paper's own mean error"
    assert "The run has no safety stop." in text
    assert (
        "Cycles by what ended their refinement: the time for it was over 20, nothing was left to improve 40." in text
    )
    assert "From cycle to cycle, ms: least 50.0" in text
    assert "sensor 7 never answers" in text
    assert "behaviors.arbiter.base_velocity_m_s" in text
    assert "The file has no summary of the run" in text


@pytest.fixture
def _no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the figures, which take most of the time."""
    monkeypatch.setattr(report_page, "_pictures", lambda *_: "")


@pytest.mark.usefixtures("_no_figures")
def test_page_without_a_known_world() -> None:
    unknown = run_page(synthetic_timeline(with_world=False), "m")
    assert "The true world is not known" in unknown
    assert PageReader(unknown).open == []
    assert "<td>1, drum</td>" in unknown


@pytest.mark.usefixtures("_no_figures")
def test_page_shows_the_summary_and_why_the_robot_stopped() -> None:
    run = synthetic_timeline()
    run.path = run.path.with_name("\udcff.mcap")
    run.modes.append(ModeEntry(2.0, "SAFE_STOP", "bumper <contact>"))
    run.summary = {
        "late": 7, "missed": 4, "link": {"frames": 1832, "bad": 3, "lost": 2}, "stop_reasons": ["bumper <contact>"],
        "timing": {"phases": {"refine": SPREAD}, "callbacks": {"link receive": SPREAD}, "late": SPREAD,
                   "faults": {"outside the process": 6}},
    }  # fmt: skip
    shown = run_page(run, "m")
    assert shown.encode().decode() == shown, "it is UTF-8, whatever the name of the file is"
    text = " ".join(PageReader(shown).text)
    for piece in ("refine", "between cycles: link receive", "lateness of a cycle's start", "1.25", "49.65"):
        assert piece in text, piece
    assert "7 cycles late, 4 missed; caused by outside the process (6)." in text
    assert "1,832" in text
    assert "bumper &lt;contact&gt;" in shown
    assert "never stopped" not in text


def test_walls_are_numbered_and_counted(shown: str) -> None:
    assert '<div class="tile"><b>1</b><span>walls recognised</span></div>' in shown
    rows = re.findall(r"<tr><td>7, wall</td><td>\((.*?)\)</td><td>\((.*?)\)</td><td>(.*?)</td>", shown)
    assert rows == [("0.00, 4.92", "9.84, 4.92", "9.84")], "ends and length, ft"
    assert 'id="models-wall-1"' in shown
    assert "recognised wall, its number" in shown


@pytest.mark.soak
def test_polylines_are_counted_and_drawn(shown: str) -> None:
    assert "polyline" not in shown
    with_one = run_page(with_polyline(synthetic_timeline()), "m")
    assert "What is not straight: 1 polyline, 2.00 m together, drawn thinner than walls in the figure." in with_one
    assert 'id="models-polylines"' in with_one


def test_a_polygon_of_ones_own_model_is_not_counted_false() -> None:
    """A table of one's own, whose model's origin is a corner, stands in the world as a polygon."""
    run = synthetic_timeline()
    bench_top = ModelConfig(
        name="bench_top", vertices_m=((0.0, 0.0), (1.2, 0.0), (1.2, 0.6), (0.0, 0.6)), closed=True
    )
    polygon = PolygonConfig(vertices_m=((2.0, 3.0), (2.0, 4.2), (1.4, 4.2), (1.4, 3.0)))
    assert run.world is not None
    run.world = run.world.model_copy(update={"polygon": (polygon,)})
    run.settings = run.settings.model_copy(update={"models": (*run.settings.models, bench_top)})
    corner = run.start.inverse().compose(Pose(2.0, 3.0, math.pi / 2))
    seen = DetectedObject("bench_top", corner.x, corner.y, corner.theta, 0.01, 30, 0.9)
    run.snapshots[-1] = replace(run.snapshots[-1], objects=(*run.snapshots[-1].objects, seen))
    shown = run_page(run, "m")
    assert re.search(r"<td>polygon 1</td><td>\(1.70, 3.60\)</td><td>\(1.70, 3.60\)</td><td>0.000</td>", shown)
    assert "<b>4 of 7</b><span>objects found, 0 false</span>" in shown
