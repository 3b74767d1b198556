"""The files of the page, and the headers of every response."""

from __future__ import annotations

import re

import pytest

from runtime.console.http.static_files import page_files, security_headers


def test_every_file_has_its_content_type() -> None:
    files = page_files()
    assert files["/"] is files["/page/index.html"]
    assert files["/page/main.js"].content_type.startswith("text/javascript")
    assert files["/page/style.css"].content_type.startswith("text/css")
    assert all(path == "/" or path.startswith("/page/") for path in files)
    assert all(file.body for file in files.values())


def test_the_policy_allows_nothing_from_elsewhere() -> None:
    policy = security_headers("robot:8765")["Content-Security-Policy"]
    assert "default-src 'self'" in policy
    assert "ws://robot:8765" in policy
    assert "unsafe" not in policy


@pytest.mark.promise("P22")
def test_no_script_makes_markup_of_text() -> None:
    """Names, reasons and lines of the log are put into the page as text."""
    unsafe = re.compile(
        rb"innerHTML|outerHTML|insertAdjacentHTML|document\.write|DOMParser|createContextualFragment|eval\("
    )
    scripts = {path: file.body for path, file in page_files().items() if path.endswith(".js")}
    assert len(scripts) > 20
    assert [path for path, body in scripts.items() if unsafe.search(body)] == []
