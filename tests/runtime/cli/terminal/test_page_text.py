"""Numbers of the terminal, as the page writes them."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from playwright._impl._driver import compute_driver_executable

from runtime import console as page_folder
from runtime.cli.terminal import page_text
from runtime.support.length_format import Units


@pytest.mark.promise("P31")
def test_the_forms_are_those_of_the_page() -> None:
    """Node runs the page's own code over the same values."""
    node, _ = compute_driver_executable()  # the one that drives the browser in tests
    values = [0.0, -0.004, 1.005, 2.675, -12.3456, 0.0005, 3.14159, -85.0, 7.7724]
    shares = [0.0, 0.004, 0.5, 0.994, 0.9951, 1.0]
    page = Path(page_folder.__file__).parent / "page"
    script = (
        f"import {{Units, degrees}} from {json.dumps((page / 'units.js').as_uri())};"
        f"const percent = {_percent(page)}; const units = new Units(); const out = [];"
        f"for (const name of ['m', 'ft']) {{ units.choose(name); for (const v of {values})"
        " out.push(units.number(v), units.length(v, 3), units.place(v, -v), degrees(v)); }"
        f"for (const s of {shares}) out.push(percent(s)); console.log(JSON.stringify(out));"
    )
    done = subprocess.run([node, "--input-type=module", "-e", script], capture_output=True, check=True, timeout=60)
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
    assert json.loads(done.stdout) == [*ours, *map(page_text.percent, shares)]


def _percent(page: Path) -> str:
    """Return the page's function as its source has it."""
    text = (page / "draw_objects.js").read_text(encoding="utf-8")
    found = re.search(r"export const percent = (.*);", text)
    assert found is not None
    return found[1]
