// @ts-check
// Teleoperation inputs: the pad under a pointer, keys, and a gamepad's stick with its shoulder button pressed.

import { byId, byKey, PRESS_ENDS } from "./dom.js";

const PAD_KEYS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };
const KEYS = new Map(Object.entries({ KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1] }));
const SHOULDERS = [4, 5];
const DEAD_ZONE = 0.12;

/** @param {Teleoperation} drive */
export function watchPad(drive) {
  const pad = byId("pad"),
    knob = byId("knob");
  let pointer = /** @type {number | null} */ (null);

  /** @param {number} dx @param {number} dy */
  const put = (dx, dy) => {
    knob.style.transform = dx === 0 && dy === 0 ? "" : `translate(${dx}px, ${dy}px)`;
  };
  /** @param {PointerEvent} event */
  const pull = (event) => {
    const box = pad.getBoundingClientRect();
    const reach = box.width / 2 - 22;
    let dx = event.clientX - box.left - box.width / 2,
      dy = event.clientY - box.top - box.height / 2;
    const far = Math.hypot(dx, dy);
    if (far > reach) [dx, dy] = [(dx / far) * reach, (dy / far) * reach];
    if (!drive.hold("pad", -dy / reach, -dx / reach)) return false;
    put(dx, dy);
    return true;
  };
  const release = () => {
    pointer = null;
    put(0, 0);
    drive.release("pad");
  };
  pad.addEventListener("pointerdown", (event) => {
    if (pointer !== null) return;
    event.preventDefault();
    pad.focus({ preventScroll: true });
    if (!pull(event)) return;
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
  });
  pad.addEventListener("pointermove", (event) => event.pointerId === pointer && drive.holding && pull(event));
  for (const name of PRESS_ENDS) {
    pad.addEventListener(name, (event) => event.pointerId === pointer && release());
  }
  drive.on("changed", () => !drive.holding && put(0, 0));
  holdKeys(drive, pad, (event) => byKey(event, PAD_KEYS), "pad key");
}

/** @param {Teleoperation} drive @param {() => boolean} enabled @param {() => boolean} elsewhere */
export function watchKeys(drive, enabled, elsewhere) {
  // With Shift the letters keep their other meanings: Shift+A arms.
  holdKeys(
    drive,
    window,
    (event) => (enabled() && !event.shiftKey && !elsewhere() ? KEYS.get(event.code) : undefined),
    "key",
  );
}

// A key counts as held from keydown to keyup; auto-repeat changes nothing.
/**
 * @param {Teleoperation} drive @param {HTMLElement | Window} target
 * @param {(event: KeyboardEvent) => number[] | undefined} directionOf @param {string} name
 */
function holdKeys(drive, target, directionOf, name) {
  /** @param {KeyboardEvent} event */
  const press = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = directionOf(event);
    if (by === undefined) return;
    event.preventDefault();
    if (!event.repeat) drive.hold(`${name} ${event.code}`, by[0], by[1]);
  };
  target.addEventListener("keydown", (event) => event instanceof KeyboardEvent && press(event));
  window.addEventListener("keyup", (event) => drive.release(`${name} ${event.code}`));
  if (target !== window)
    target.addEventListener("blur", () => Object.keys(PAD_KEYS).forEach((code) => drive.release(`${name} ${code}`)));
}

// Gamepads send no events for their sticks: poll once per animation frame while one is connected.
/** @param {Teleoperation} drive @param {(text: string) => void} tell */
export function watchGamepad(drive, tell) {
  let known = 0;
  let looking = false;

  const pads = () => [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad !== null);
  /** @param {number} value */
  const dead = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : value);
  const look = () => {
    const found = pads();
    if (found.length === 0) {
      looking = false;
      drive.release("gamepad");
      tell("no gamepad");
      return;
    }
    const held = found.find((pad) => SHOULDERS.some((button) => pad.buttons[button]?.pressed));
    if (held && !pressedInVain) {
      if (!drive.hold("gamepad", -dead(held.axes[1] ?? 0), -dead(held.axes[0] ?? 0))) pressedInVain = true;
    } else if (!held) {
      pressedInVain = false;
      drive.release("gamepad");
    }
    requestAnimationFrame(look);
  };
  let pressedInVain = false; // after a refusal the button must be released before the next attempt
  drive.on("changed", (why) => {
    if (why !== null) pressedInVain = true;
  });
  addEventListener("gamepadconnected", (event) => {
    known++;
    tell(`gamepad: hold a shoulder button and use the left stick (${event.gamepad?.id?.slice(0, 40) ?? known})`);
    if (looking) return;
    looking = true;
    requestAnimationFrame(look);
  });
  addEventListener("gamepaddisconnected", () => {
    drive.release("gamepad");
    if (pads().length === 0) tell("no gamepad");
  });
}
