"""The settings files in the page: problems beside lines, the difference, saving, and a restart."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import PHONE, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

TEXT = "[ring]\ncount = 24\n"


async def test_a_file_is_changed_checked_and_saved(server: FakeServer, opener: Opener) -> None:
    server.data |= {
        "list_settings": [{"kind": "world", "name": "worlds/a.toml", "shipped": True},
                          {"kind": "robot", "name": "my.toml", "shipped": False}],
        "read_settings": {"text": TEXT, "digest": "a" * 64, "form": []},
        "check_settings": {"problems": [{"line": 2, "text": "ring.count = 1: <b>too few</b>"}], "warnings": [],
                           "difference": "--- my.toml\n+++ my.toml, changed\n-count = 24\n+count = 1", "form": []},
        "save_settings": {"text": "changed", "digest": "b" * 64, "form": []},
    }  # fmt: skip
    opened = await opener.open(server.url)
    page = opened.page
    await page.click("#tab-tune")
    await page.click("#settings-open")
    text, save = page.locator("#settings-text"), page.locator("#settings-save")
    await expect(page.locator("#settings-file")).to_have_value("1")
    await expect(text).to_have_value(TEXT)
    await expect(save).to_be_disabled()
    await text.fill("[ring]\ncount = 1\n")
    await opened.run_for(500)
    await expect(page.locator("#settings-problems li")).to_have_text("line 2: ring.count = 1: <b>too few</b>")
    await expect(page.locator("#settings-lines b")).to_have_text("✗ 2")
    await expect(page.locator("#settings-difference .added")).to_have_text("+count = 1")
    await expect(save).to_be_disabled()
    await page.locator("#settings-problems button").click()
    assert await text.evaluate("area => area.value.slice(area.selectionStart, area.selectionEnd)") == "count = 1"
    server.data["check_settings"] = {"problems": [], "warnings": ["slow"], "difference": "+count = 23", "form": []}
    await text.fill("[ring]\ncount = 23\n")
    await opened.run_for(500)
    await expect(save).to_be_enabled()
    await save.click()
    sent = await server.wait("save_settings")
    assert sent == {"file": 1, "toml": "[ring]\ncount = 23\n", "digest": "a" * 64}
    await expect(page.locator("#settings-state")).to_contain_text("Saved")
    await page.keyboard.press("Escape")
    await expect(page.locator("#settings")).to_be_hidden()


async def test_the_text_of_a_file_that_was_left_is_not_shown(server: FakeServer, opener: Opener) -> None:
    server.data |= {
        "list_settings": [{"kind": "robot", "name": name, "shipped": False} for name in ("a.toml", "b.toml")],
        "read_settings": {"text": TEXT, "digest": "a" * 64, "form": []},
    }
    opened = await opener.open(server.url)
    page, text = opened.page, opened.page.locator("#settings-text")
    await page.click("#tab-tune")
    await page.click("#settings-open")
    await expect(text).to_have_value(TEXT)
    server.holds = {"read_settings"}
    server.data["read_settings"] = {"text": "# b\n", "digest": "b" * 64, "form": []}
    await page.locator("#settings-file").select_option("1")
    await server.wait("read_settings", 2)
    server.data["read_settings"] = {"text": "# a\n", "digest": "c" * 64, "form": []}
    await page.locator("#settings-file").select_option("0")
    await server.wait("read_settings", 3)
    server.held.reverse()
    await server.release()
    await opened.sync()
    await expect(text).to_have_value("# a\n")


async def test_a_change_is_not_lost_and_a_restart_waits_for_a_robot_that_stands(
    server: FakeServer, opener: Opener
) -> None:
    server.data |= {
        "list_settings": [{"kind": "robot", "name": "my.toml", "shipped": False}],
        "read_settings": {"text": TEXT, "digest": "a" * 64, "form": []},
        "check_settings": {"problems": [], "warnings": [], "difference": "+x", "form": []},
    }
    opened = await opener.open(server.url)
    page = opened.page
    await page.click("#tab-tune")
    await page.click("#settings-open")
    await page.locator("#settings-text").fill("changed")
    await page.click("#settings-close")
    await page.get_by_role("button", name="Go on changing it").click()
    await expect(page.locator("#settings")).to_be_visible()
    await page.click("#settings-close")
    await page.get_by_role("button", name="Leave it unsaved").click()
    await expect(page.locator("#settings")).to_be_hidden()
    await page.click("#settings-open")
    await page.locator("#settings-text").fill("changed once more")
    await expect(page.locator("#settings-restart")).to_be_disabled()
    server.mode = "READY"
    await expect(page.locator("#settings-restart")).to_be_enabled()
    await page.click("#settings-restart")
    await page.get_by_role("button", name="Leave it unsaved").click()
    await page.get_by_role("button", name="Start it again").click()
    await server.wait("restart_run")


async def test_title_and_buttons_stay_in_view_on_a_phone(server: FakeServer, opener: Opener) -> None:
    server.data |= {
        "list_settings": [{"kind": "robot", "name": "my.toml", "shipped": False}],
        "read_settings": {"text": TEXT + 60 * "# a line\n", "digest": "a" * 64, "form": []},
        "check_settings": {"problems": [{"line": 2, "text": 30 * "long "}], "warnings": [30 * "word "],
                           "difference": 30 * "+x\n", "form": []},
    }  # fmt: skip
    opened = await opener.open(server.url, PHONE)
    page = opened.page
    await page.click("#tab-tune")
    await page.click("#settings-open")
    await expect(page.locator("#settings-text")).not_to_have_value("")
    await page.locator("#settings-text").fill("[ring]\ncount = 1\n")
    await opened.run_for(500)
    await expect(page.locator("#settings-problems li").first).to_contain_text("long")
    bar = await page.locator(".bar").bounding_box()
    for name in ("close", "copy", "restart", "save"):
        box = await page.locator(f"#settings-{name}").bounding_box()
        assert box is not None
        assert bar is not None
        assert bar["y"] + bar["height"] <= box["y"], name
        assert box["y"] + box["height"] <= PHONE[1], name


async def test_a_table_of_an_installed_package_is_a_form_that_changes_the_text(
    server: FakeServer, opener: Opener
) -> None:
    trim = {"path": "skippy.trim", "label": "trim", "value": 1.0, "low": 0.0, "high": 2.0, "kind": "float",
            "choices": None, "optional": False, "help": "Counts."}  # fmt: skip
    masks = {**trim, "path": "skippy.masks", "label": "masks", "value": "[1, 2]", "low": None, "high": None,
             "kind": "toml", "help": "Fire."}  # fmt: skip
    form = [{"title": "skippy", "help": "Of <b>skippy</b>.", "fields": [trim, masks]}]
    server.data |= {
        "list_settings": [{"kind": "robot", "name": "my.toml", "shipped": False},
                          {"kind": "robot", "name": "robots/skippy.toml", "shipped": True}],
        "read_settings": {"text": TEXT, "digest": "a" * 64, "form": form},
        "check_settings": {"problems": [], "warnings": [], "difference": "+x",
                           "form": [{**form[0], "fields": [{**trim, "value": 1.25}, masks]}]},
        "change_settings": TEXT + "[skippy]\ntrim = 1.25\n",
    }  # fmt: skip
    opened = await opener.open(server.url)
    page = opened.page
    await page.click("#tab-tune")
    await page.click("#settings-open")
    field = page.get_by_label("trim", exact=True)
    await expect(field).to_have_value("1")
    await expect(page.locator("#settings-form .hint")).to_have_text("Of <b>skippy</b>.")
    await expect(page.locator("#settings-form .help").first).to_have_text("Counts. 0 to 2.")
    await field.fill("one")
    await field.press("Enter")
    await expect(page.locator("#settings-form .error").first).to_have_text("a number is wanted")
    await field.fill("1.25")
    await field.press("Enter")
    sent = await server.wait("change_settings")
    assert sent == {"file": 0, "toml": TEXT, "path": "skippy.trim", "value": 1.25}
    await expect(page.locator("#settings-text")).to_have_value(TEXT + "[skippy]\ntrim = 1.25\n")
    await opened.run_for(500)
    await expect(page.locator("#settings-save")).to_be_enabled()
    await expect(page.locator("#settings-form .field.changed")).to_have_count(1)
    await page.get_by_label("masks", exact=True).fill("")
    await page.get_by_label("masks", exact=True).press("Enter")
    assert (await server.wait("change_settings", 2))["value"] is None
    await page.select_option("#settings-file", "1")
    await page.locator("#dialog-buttons button").last.click()
    await expect(field).to_be_disabled()
