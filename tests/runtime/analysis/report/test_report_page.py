"""The page of a run: whole, alone, small, and true."""

from __future__ import annotations

import html
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.analysis.report.html_parts import note, table
from runtime.analysis.report.inline_svg import VARIABLES, inlined
from runtime.analysis.report.stylesheet import CSS
from runtime.cli.app import run_command

VOID = {"meta", "link", "br", "img", "hr", "input", "use", "path"}
SIZE_MAX = 3_000_000


class Reader(HTMLParser):
    """Collects a page's tags, ids, references and text, and whether every tag is closed."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in {"href", "src", "xlink:href", "action", "data", "srcset"}:
                self.links.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def page(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("page") / "hall.html"
    assert run_command(["report", str(hall_run), "--out", str(path), "--units", "ft"]) == DONE
    return path.read_text("utf-8")


def test_page_is_self_contained(page: str) -> None:
    reader = Reader(page)
    assert reader.open == []
    assert all(link.startswith("#") for link in reader.links), reader.links
    assert {link[1:] for link in reader.links} <= set(reader.ids)
    assert len(reader.ids) == len(set(reader.ids))
    assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", page)
    assert "script" not in reader.tags
    assert set(re.findall(r"url\(#([^)]*)\)", page)) <= set(reader.ids)
    assert len(page.encode()) < SIZE_MAX


def test_page_shows_the_run(page: str) -> None:
    text = " ".join(Reader(page).text)
    for title in ("Objects", "Figures", "Timing", "Link", "Modes and stop reasons", "Settings", "Made by"):
        assert title in text
    assert page.count("<svg") == 5
    drums = re.findall(r"<td>drum \d</td><td>\(([^)]*)\)</td>", page)
    assert drums == ["1.00, 4.00", "4.00, 4.00", "7.00, 4.00", "1.00, -4.00", "4.00, -4.00", "7.00, -4.00"]
    errors = [float(e) for e in re.findall(r"\(-?[\d.]+, -?[\d.]+\)</td><td>([\d.]+)</td>", page)]
    assert len(errors) >= 3
    assert max(errors) < 0.1
    named = re.findall(r"<td>(drum \d), semicircle</td>", page)
    assert len(set(named)) == len(named) == len(errors), "each by the name that it has in Table 2"
    assert "not found" in text, "the last drums are not reached in that time"
    assert "The robot never stopped for a reason." in text
    assert "behaviors.arbiter.base_velocity_m_s" in text
    assert "Refinement ended by: budget" in text
    assert "0.249 ft" in text


def test_page_of_a_ring_log(hall_log: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_bytes(hall_log.read_bytes())
    assert run_command(["report", str(log)]) == DONE
    page = (tmp_path / "log.html").read_text("utf-8")
    assert "The true world is not known" in page
    assert Reader(page).open == []


def test_content_is_escaped() -> None:
    evil = "<script>alert('x')</script>&\""
    for made in (table([evil], [[evil]]), note(evil)):
        assert "<script" not in made
        assert html.escape(evil) in made


def test_inlined_svg() -> None:
    svg = (
        '<?xml version="1.0"?><!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/x.dtd">'
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"><!-- a -->'
        '<g id="a"><path d="M 1.23456 2" style="stroke: #0072b2" clip-path="url(#c)"/>'
        '<use xlink:href="#a"/></g></svg>'
    )
    assert inlined(svg, "p", "label") == (
        '<svg role="img" aria-label="label"><g id="p-a"><path d="M 1.23 2" style="stroke: var(--echo)" '
        'clip-path="url(#p-c)"/><use href="#p-a"/></g></svg>'
    )
    for variable in VARIABLES.values():
        assert CSS.count(f"{variable}:") == 2, "in light and dark mode"
