"""Driving from the page: HALT, arming, the deadman of pad, keys and gamepad, goals, control."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import expect

from drivers.messages import Pose
from tests.browser.fake_server import FakeServer
from tests.browser.open_page import FRAME_MS, PHONE, Opened, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

EVERY_MS = 50
SIZES = ((360, 740), (360, 500), (740, 360), (1440, 900), (1920, 1080))
FOCI = {"body": None, "#map-front": None, "#tab-log": None, "#teleop-keys": "Drive", "#ellipse-scale": "Layers",
        "#teleop-limit": "Drive", "#fit": None}  # fmt: skip
"""What has the focus, and the panel that it is on."""

CAPITAL = "() => document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'A', bubbles: true }))"

GAMEPAD = """
const pad = {connected: true, id: 'a pad', index: 0, axes: [0, 0, 0, 0],
  buttons: Array.from({length: 16}, () => ({pressed: false, value: 0}))};
window.padUnderTest = pad;
window.plugIn = () => dispatchEvent(Object.assign(new Event('gamepadconnected'), { gamepad: pad }));
navigator.getGamepads = () => (pad.connected ? [pad] : []);
"""


def commands(server: FakeServer) -> list[tuple[float, float]]:
    """Return the velocities received so far, m/s and rad/s."""
    return [(message["v"], message["w"]) for message in server.of("teleoperate")]


async def drives(server: FakeServer, opened: Opened) -> tuple[float, float]:
    """Check that the page sends a velocity every 50 ms; return it."""
    await opened.sync()
    count = len(commands(server))
    await opened.run_for(4 * EVERY_MS)
    await opened.sync()
    sent = commands(server)[count:]
    assert len(sent) == 4
    assert len(set(sent)) == 1
    return sent[0]


async def has_let_go(server: FakeServer, opened: Opened) -> None:
    """Check that the last command is zero, and that none follows it."""
    await opened.sync()  # the page has the state that stops it,
    await opened.sync()  # and the server what the page sent thereupon
    count = len(commands(server))
    assert commands(server)[-1] == (0, 0)
    await opened.run_for(6 * EVERY_MS)
    await opened.sync()
    assert len(commands(server)) == count, "it goes on sending though nothing is held"


async def test_halt_is_on_screen_whatever_is_open(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for count, (width, height) in enumerate(SIZES, start=1):
        await opened.page.set_viewport_size({"width": width, "height": height})
        await opened.until(f"innerWidth === {width} && innerHeight === {height}", "the size")
        await opened.page.keyboard.press("?")
        await expect(opened.page.locator("#dialog")).to_be_visible()
        halt = opened.page.get_by_role("button", name="HALT")
        await expect(halt).to_be_in_viewport(ratio=1.0)
        await halt.click()  # what lies over it would take the click
        await server.wait("halt", count)
        await opened.says("#mode-name", "SAFE STOP")
        server.mode, server.reason = "DRIVE", None
        await opened.says("#mode-name", "DRIVE")


async def test_halt_latches_and_shows_the_reason(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.page.get_by_role("button", name="HALT").click()
    assert await server.wait("halt") == {}
    await opened.says("#mode-name", "SAFE STOP")
    await opened.says("#reason", "halted by the operator")
    await opened.says("#announce", "Mode safe stop: halted by the operator")
    await opened.says("#banner-stopped", "halted by the operator")
    await opened.save_screenshot("halted")
    assert not server.of("arm"), "nothing arms by itself"
    await opened.page.locator("#banner-stopped").get_by_role("button", name="Re-arm").click()
    assert await server.wait("arm") == {}
    await opened.says("#mode-name", "DRIVE")
    await expect(opened.page.locator("#banner-stopped")).to_have_count(0)


async def test_the_space_bar_halts_wherever_the_focus_is_but_in_text(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for count, (target, panel) in enumerate(FOCI.items(), start=1):
        if panel is not None:
            await opened.tab(panel)
        await opened.page.locator(target).focus()
        scale = await opened.world("view.scale")
        await opened.page.keyboard.press("Space")
        await opened.sync()
        assert len(server.of("halt")) == count, target
        assert await opened.page.locator("#teleop-keys").is_checked() is False
        assert await opened.world("view.scale") == scale, "and presses no button besides"
    await opened.tab("Time")
    await opened.page.locator("#bookmark-text").press_sequentially("a b")
    await expect(opened.page.locator("#bookmark-text")).to_have_value("a b")
    await opened.sync()
    assert len(server.of("halt")) == len(FOCI)


async def test_arm_and_disarm(server: FakeServer, opener: Opener) -> None:
    server.mode = "READY"
    opened = await opener.open(server.url)
    await opened.tab("Drive")
    await opened.page.get_by_role("button", name="Arm", exact=True).click()
    await server.wait("arm")
    await opened.says("#mode-name", "DRIVE")
    await expect(opened.page.get_by_role("button", name="Arm", exact=True)).to_be_disabled()
    await opened.page.get_by_role("button", name="Disarm").click()
    await server.wait("disarm")
    await opened.says("#mode-name", "READY")
    await opened.page.locator("#map-front").focus()
    await opened.page.keyboard.press("Shift+A")
    await server.wait("arm", 2)
    server.mode = "READY"
    await opened.says("#mode-name", "READY")
    await opened.page.evaluate(CAPITAL)
    await opened.page.keyboard.press("u")
    await opened.says("#units", "m")
    await opened.sync()
    assert len(server.of("arm")) == 2, "locked capitals arm nothing"


async def test_an_observer_can_halt_but_not_drive(server: FakeServer, opener: Opener) -> None:
    server.controller = 99
    opened = await opener.open(server.url)
    await opened.tab("Drive")
    await opened.says("#role-text", "You watch")
    await opened.says("#banner-watching", "You are watching")
    for name in ("Arm", "Disarm", "As configured", "Goal on the map"):
        await expect(opened.page.get_by_role("button", name=name, exact=True)).to_be_disabled()
    pad = await opened.page.locator("#pad").bounding_box()
    assert pad is not None
    await opened.page.mouse.move(pad["x"] + 70, pad["y"] + 20)
    await opened.page.mouse.down()
    await opened.says("#toasts", "ask for control first")
    await opened.page.mouse.up()
    await opened.sync()
    assert not server.of("teleoperate")
    await opened.save_screenshot("watching")
    await opened.page.keyboard.press("Space")
    await server.wait("halt")


async def test_control_is_requested_and_handed_over(server: FakeServer, opener: Opener) -> None:
    first = await opener.open(server.url)
    second = await opener.open(server.url)
    server.refusals["take_control"] = ("client 1 has the control and has been asked for it", None)
    await second.page.locator("#banner-watching").get_by_role("button", name="Ask for control").click()
    await server.wait("take_control")
    await second.says("#toasts", "has been asked for it")
    await server.send({"type": "role", "role": "control", "asked_by": "client 2 (127.0.0.1)", "client": 2})
    await first.says("#banner-asked", "client 2 (127.0.0.1) asks for control")
    await first.save_screenshot("asked")
    await first.page.locator("#banner-asked").get_by_role("button", name="Hand over").click()
    assert await server.wait("grant_control") == {"client": 2}
    server.controller = 2
    await second.tab("Drive")
    await second.says("#role-text", "You control")
    await first.tab("Drive")
    await first.says("#role-text", "You watch")
    await second.page.get_by_role("button", name="Give control away").click()
    await server.wait("release_control")
    await second.says("#role-text", "You watch")


async def press_pad(opened: Opened, x: float, y: float) -> None:
    """Press the pad in the middle and drag to a point, in fractions of its radius."""
    await opened.tab("Drive")
    await opened.page.locator("#pad").scroll_into_view_if_needed()
    box = await opened.page.locator("#pad").bounding_box()
    assert box is not None
    cx, cy, r = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["width"] / 2 - 22
    await opened.page.mouse.move(cx, cy)
    await opened.page.mouse.down()
    await opened.page.mouse.move(cx + x * r, cy - y * r, steps=3)


async def test_the_pad_drives_while_it_is_held(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await press_pad(opened, -0.5, 1.0)
    v, w = await drives(server, opened)
    assert v == pytest.approx(0.5 * 0.5 * 0.894, abs=0.02), "half the speed at most, as far forward as the knob"
    assert w == pytest.approx(0.5 * 1.0 * 0.447, abs=0.03), "left is counter-clockwise"
    await opened.says("#teleop-state", "driving:")
    await opened.save_screenshot("pad")
    await opened.page.mouse.up()
    await has_let_go(server, opened)
    await opened.says("#teleop-state", "released")


async def test_keys_drive_only_where_they_are_meant_to(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await page.locator("#map-front").focus()
    await page.keyboard.down("w")
    await page.keyboard.up("w")
    await opened.sync()
    assert not server.of("teleoperate")
    await opened.tab("Drive")
    await page.locator("#teleop-keys").focus()
    await page.keyboard.press("Enter")
    await expect(page.locator("#teleop-keys")).to_be_checked()
    await page.keyboard.down("w")
    await page.keyboard.down("d")
    assert await drives(server, opened) == (0.25, -0.5)
    await page.keyboard.up("w")
    assert await drives(server, opened) == (0, -0.5)
    await page.keyboard.up("d")
    await has_let_go(server, opened)
    await page.keyboard.press("Space")
    await opened.says("#mode-name", "SAFE STOP")
    await page.keyboard.press("Shift+A")
    await server.wait("arm")
    await opened.says("#mode-name", "DRIVE")
    await has_let_go(server, opened)

    await page.locator("#teleop-limit").focus()
    await page.keyboard.press("End")
    await opened.says("#teleop-limit-value", "100 %")
    await page.locator("#pad").focus()
    await page.keyboard.down("ArrowDown")
    assert (await drives(server, opened))[0] == -0.5
    await page.keyboard.up("ArrowDown")
    await has_let_go(server, opened)


async def test_a_gamepad_drives_only_with_its_shoulder_button(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url, script=GAMEPAD)
    page = opened.page
    await page.evaluate("() => plugIn()")
    await opened.tab("Drive")
    await opened.says("#teleop-gamepad", "a pad")
    await page.evaluate("() => { padUnderTest.axes[1] = -1; }")
    await opened.run_for(4 * EVERY_MS)
    await opened.sync()
    assert not server.of("teleoperate"), "the stick alone moves nothing"
    await page.evaluate("() => { padUnderTest.buttons[5].pressed = true; }")
    await opened.run_for(FRAME_MS)
    assert (await drives(server, opened))[0] == 0.25
    await page.evaluate("() => { padUnderTest.connected = false; dispatchEvent(new Event('gamepaddisconnected')); }")
    await has_let_go(server, opened)
    await opened.says("#teleop-gamepad", "no gamepad")


LOSSES: dict[str, str] = {
    "blur": "() => dispatchEvent(new Event('blur'))",
    "hidden": "() => { Object.defineProperty(document, 'hidden', {value: true});"
              " document.dispatchEvent(new Event('visibilitychange')); }",
    "pointercancel": "() => document.getElementById('pad').dispatchEvent("
                     "new PointerEvent('pointercancel', {pointerId: 1}))",
    "lostpointercapture": "() => document.getElementById('pad').releasePointerCapture(1)",
}  # fmt: skip


async def test_any_loss_stops_teleoperation(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for loss in LOSSES:
        await press_pad(opened, 0.0, 1.0)
        await drives(server, opened)
        await opened.page.evaluate(LOSSES[loss])
        if loss == "lostpointercapture":
            await opened.page.mouse.move(11, 400)  # a browser may announce this loss only at the next movement
        await has_let_go(server, opened)
        await opened.page.mouse.move(10, 400, steps=3)  # moving on with the button down holds nothing again
        await has_let_go(server, opened)
        await opened.page.mouse.up()


async def test_halt_and_leaving_drive_stop_teleoperation(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await press_pad(opened, 0.0, 1.0)
    await drives(server, opened)
    await opened.page.keyboard.press("Space")
    await has_let_go(server, opened)
    await opened.page.mouse.up()
    await opened.says("#mode-name", "SAFE STOP")

    server.mode = "DRIVE"
    await opened.says("#mode-name", "DRIVE")
    await press_pad(opened, 0.0, 1.0)
    await drives(server, opened)
    server.mode, server.reason = "SAFE_STOP", "bumper contact"
    await has_let_go(server, opened)
    await opened.says("#teleop-state", "stopped: the mode is SAFE STOP")


async def test_losing_control_or_leaving_the_page_stops_teleoperation(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await press_pad(opened, 0.0, 1.0)
    await drives(server, opened)
    server.controller = None
    await opened.sync()
    await has_let_go(server, opened)
    await opened.page.mouse.up()

    server.controller = 1
    await opened.sync()
    await press_pad(opened, 0.0, 1.0)
    await drives(server, opened)
    await opened.page.goto("about:blank")
    await server.wait_for_clients(0)
    assert commands(server)[-1] == (0, 0)


async def in_odometry(opened: Opened, goal: dict[str, Any]) -> tuple[float, float]:
    """Return where a goal lies in the plane that the page shows: it is given in the map of a located robot."""
    assert goal["frame"] == "map"
    x, y, turn = await opened.world("run.state.localized.frame")
    place = Pose(x, y, turn).compose(Pose(goal["x"], goal["y"], 0.0))
    return place.x, place.y


async def test_a_goal_by_click_and_by_numbers(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.steady()
    page = opened.page
    await opened.tab("Drive")
    await page.get_by_role("button", name="Goal on the map").click()
    await page.mouse.click(*await opened.screen(3.2, -0.2))
    goal = await server.wait("goal")
    assert await in_odometry(opened, goal) == pytest.approx((3.2, -0.2), abs=0.02)
    await opened.says("#drive-request-text", "To the goal at 10.3")
    await opened.save_screenshot("goal")
    await page.locator("#goal-x").fill("10")
    await page.locator("#goal-y").fill("-1,5")
    await page.keyboard.press("Enter")
    typed = await server.wait("goal", 2)
    assert await in_odometry(opened, typed) == pytest.approx((3.048, -0.4572))
    await page.locator("#goal-x").fill("far")
    await page.locator("#goal-x").press("Enter")
    await opened.says("#goal-error", "two numbers")
    server.refusals["goal"] = ("the goal is 90 m away, 50 at most", None)
    await page.locator("#goal-x").fill("300")
    await page.locator("#goal-x").press("Enter")
    await opened.says("#goal-error", "90 m away")
    server.refusals.clear()
    await page.get_by_role("button", name="As configured").click()
    assert await server.wait("legs") == {}
    await opened.says("#drive-request-text", "as configured")


async def test_a_goal_and_gains_with_the_keyboard_alone(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.steady()
    await opened.page.locator("#map-front").focus()
    await opened.page.keyboard.press("5")
    for _ in range(3):
        await opened.page.keyboard.press("ArrowRight")
    x, y = await opened.world("view.toWorld(view.width / 2 + 72, view.height / 2)")
    await opened.page.keyboard.press("Enter")
    goal = await server.wait("goal")
    assert await in_odometry(opened, goal) == pytest.approx((x, y), abs=1e-6)

    await opened.tab("Drive")
    gain = opened.page.locator("#drive-gains").get_by_label("move ahead gain")
    await gain.fill("0.5")
    await gain.press("Enter")
    assert await server.wait("set_parameter") == {"path": "behaviors.move_ahead.move_ahead_gain", "value": 0.5}


async def test_a_thumb_drives_and_halts_on_a_phone(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url, PHONE, touch=True)
    await opened.page.get_by_role("tab", name="Drive").tap()
    await opened.page.locator("#pad").scroll_into_view_if_needed()
    box = await opened.page.locator("#pad").bounding_box()
    assert box is not None
    touch = await opened.page.context.new_cdp_session(opened.page)
    x, y = box["x"] + box["width"] / 2, box["y"] + 30
    await touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    assert (await drives(server, opened))[0] > 0.2
    await opened.save_screenshot("phone-driving")
    await touch.send("Input.dispatchTouchEvent", {"type": "touchCancel", "touchPoints": []})
    await has_let_go(server, opened)
    await opened.page.get_by_role("button", name="HALT").tap()
    await server.wait("halt")
