"""Tests of figures inside a page: no header, unique ids, few digits, and the page's colours."""

from __future__ import annotations

from runtime.analysis.report.inline_svg import inlined


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


def test_fonts_are_those_of_the_page() -> None:
    svg = "<svg><text style=\"font: 8.5px 'DejaVu Sans', sans; fill: #1c1c1c\">a</text></svg>"
    assert inlined(svg, "p", "x") == (
        '<svg role="img" aria-label="x"><text style="font: 8.5px system-ui, sans-serif; fill: var(--ink)">a</text>'
        "</svg>"
    )


def test_the_labels_of_an_axis_keep_their_digits() -> None:
    """Ticks of 0.0010, 0.0015 and 0.0020 were all shown as 0.00."""
    svg = '<svg><g transform="translate(1.23456 2)"><text>0.0015</text></g></svg>'
    assert inlined(svg, "p", "x") == (
        '<svg role="img" aria-label="x"><g transform="translate(1.23 2)"><text>0.0015</text></g></svg>'
    )
