"""Numbers of the terminal, as the page writes them."""

from __future__ import annotations

import json
import math
import random
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright._impl._driver import compute_driver_executable

from perception.detected_object import DetectedObject
from runtime import console as page_folder
from runtime.cli.terminal import page_text
from runtime.support.length_format import Units
from tests.hil.machine import TIMEOUT_S

NODE, _ = compute_driver_executable()  # the one that drives the browser in tests


def printed(script: str) -> Any:
    """Return what a script of the page's language prints as JSON."""
    command = [NODE, "--input-type=module", "-e", script]
    return json.loads(subprocess.run(command, capture_output=True, check=True, timeout=TIMEOUT_S).stdout)


@pytest.mark.promise("P31")
def test_the_forms_are_those_of_the_page() -> None:
    """Node runs the page's own code over the same values."""
    rng = random.Random(3)
    values = [0.0, -0.004, 1.005, 2.675, -12.3456, 0.0005, 3.14159, -85.0, 7.7724]
    shares = [0.0, 0.004, 0.5, 0.994, 0.995, 0.9951, 1.0, *(rng.random() for _ in range(50))]
    sigmas = [0.0, 3e-5, 7e-4, 0.001, 0.04, *(10.0 ** rng.uniform(-9.0, 9.0) for _ in range(50))]
    page = Path(page_folder.__file__).parent / "page"
    script = (
        f"import {{Units, degrees, percent, turnSpread}} from {json.dumps((page / 'units.js').as_uri())};"
        "const units = new Units(); const out = [];"
        f"for (const name of ['m', 'ft']) {{ units.choose(name); for (const v of {values})"
        " out.push(units.number(v), units.length(v, 3), units.place(v, -v), degrees(v)); }"
        f"for (const s of {shares}) out.push(percent(s));"
        f"for (const s of {sigmas}) out.push(units.spread(s), turnSpread(s)); console.log(JSON.stringify(out));"
    )
    units: tuple[Units, ...] = ("m", "ft")
    ours = [
        form
        for unit in units
        for v in values
        for form in (
            page_text.number(v, unit), page_text.length(v, unit, 3), page_text.place(v, -v, unit),
            page_text.degrees(v),
        )
    ]  # fmt: skip
    spreads = [said for sigma in sigmas for said in (page_text.spread(sigma, "ft"), page_text.turn_spread(sigma))]
    assert printed(script) == [*ours, *map(page_text.percent, shares), *spreads]


@pytest.mark.parametrize("exponent", range(-30, 31, 3))
def test_no_probability_is_0_or_100_and_no_uncertainty_is_nought(exponent: int) -> None:
    small = 10.0**-exponent if exponent >= 0 else 10.0**exponent
    for said in (page_text.percent(share) for share in (small, 1.0 - small, 0.0, 1.0)):
        assert not said.startswith(("0 ", "100 ")), said
    assert re.search("[1-9]", page_text.spread(10.0**exponent, "m"))
    assert re.search("[1-9]", page_text.turn_spread(10.0**exponent))


def test_odds_on_the_page_end_at_a_million_and_magnitudes_at_a_thousand() -> None:
    """Node runs the page's own code; the longest said before had 434,294,469 digits."""
    page = Path(page_folder.__file__).parent / "page"
    logarithms = [0.0, 0.7, 2.4, 9.3, 11.5, 13.7, 13.9, 1e3, 1e9]
    script = (
        f"import {{magnitude, times}} from {json.dumps((page / 'units.js').as_uri())};"
        f"console.log(JSON.stringify([...{logarithms}.map(times), ...[0.5, 99.9, 1e6].map(magnitude)]));"
    )
    million = "more than a million"
    assert printed(script) == ["1", "2", "11", "10⁴", "10⁵", "10⁶", million, million, million,
                                      "0.50", "99.90", "unbounded"]  # fmt: skip


@pytest.mark.promise("P31")
def test_what_a_wall_hides_is_what_it_hides_on_the_page(measured: Callable[[str], None]) -> None:
    """Node runs the page's own code over the same random scenes."""
    rng, cases = random.Random(16), list[list[list[float]]]()
    for _ in range(300):
        cases.append([[rng.uniform(-3.0, 3.0) for _ in range(4)], [rng.uniform(-1.0, 1.0), rng.uniform(0.2, 4.0)],
                      [rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.choice([0.1, 0.3])]])  # fmt: skip
    page = Path(page_folder.__file__).parent / "page"
    script = (
        f"import {{hidingWall}} from {json.dumps((page / 'walls.js').as_uri())};"
        f"const out = {json.dumps(cases)}.map(([[x, y, theta, half], [rx, ry], [ox, oy, radius]]) => {{"
        " const c = Math.cos(theta) * half, s = Math.sin(theta) * half;"
        " const wall = { ends: [x - c, y - s, x + c, y + s] }, seen = { x: ox, y: oy };"
        " return hidingWall({ pose: [rx, ry], objects: [wall, seen] }, seen, radius) !== null; });"
        " console.log(JSON.stringify(out));"
    )
    ours = list[bool]()
    for (x, y, theta, half), (rx, ry), (ox, oy, radius) in cases:
        along = half * half / 3.0  # of an even distribution over its length
        c, s = math.cos(theta), math.sin(theta)
        covariance = (along * c * c, along * c * s, along * s * s)
        wall = DetectedObject("wall", x, y, theta, 0.1, 9, 0.9, 0.9, covariance)
        seen = DetectedObject("drum", ox, oy, 0.0, 0.1, 9, 0.9, 0.9)
        ours.append(page_text.is_hidden(seen, radius, (rx, ry), (wall, seen)))
        assert not page_text.is_hidden(wall, 0.1, (rx, ry), (wall, wall))
    assert printed(script) == ours
    assert 20 < sum(ours) < 280
    measured(f"{len(ours)} scenes of a wall and an object: hidden in {sum(ours)}, as by the page's code")


def test_a_hidden_object_is_called_so_unless_it_was_confirmed() -> None:
    seen = DetectedObject("drum", 1.0, 2.0, 0.0, 0.1, 9, 0.9, 0.9)
    assert page_text.certainty(seen, hidden=True) == "hidden"
    assert page_text.certainty(replace(seen, confirmed=True), hidden=True) == "✓ 90 %"
