// @ts-check
// Global keys. The space bar is HALT everywhere except in text fields; Enter takes over what it usually does: press a
// button, toggle a checkbox.

import { byId, el, writesText } from "./dom.js";

const WORDS = [
  ["Space", "HALT, except while you type text"],
  ["Shift+A", "arm, or re-arm"],
  [
    "1 … 9",
    "tools: move the map, select, move an object, place a model, goal, tape, say where the robot is, waypoints, places",
  ],
  ["arrows", "on the map: move it, or the crosshair of a tool (Shift: finely)"],
  ["Enter", "on the map: what a click does; elsewhere: press a button, switch a box"],
  ["+  −", "zoom"],
  ["F", "fit everything"],
  ["L", "follow the robot"],
  ["U", "feet or metres"],
  ["A", "with the select tool: select everything in view"],
  ["Delete", "delete the selected segments; with the waypoint tool, the selected waypoint"],
  ["P  Shift+P", "pin or unpin the selected segments"],
  ["[  ]", "rotate the selected object, the model to place, or the selected waypoint's final heading"],
  ["arrows, Shift+arrows", "with the move tool: nudge the selected object by 1 cm or 10 cm"],
  ["W A S D", "drive while held, if enabled; arrows on the driving pad"],
  ["K", "pause or resume the emulator"],
  [
    "Ctrl+Z",
    "undo the last edit of the map; with the waypoint tool, of the route; with the places tool, of the places; " +
      "in Tune, the last parameter; in Files, the last name or pin; in Time, the last bookmark",
  ],
  ["Escape", "cancel; clear the selection"],
  ["?", "this list"],
];

/**
 * @param {Pick<Parts, "tools" | "view" | "notifications"> & {
 *   drive: import("./drive.js").Drive;
 *   time: import("./time.js").Time;
 *   chosen: Record<"delete" | "pin" | "unpin", () => void>;
 *   fit: () => void;
 *   undo: () => void;
 *   drivingByKeys: () => boolean;
 * }} parts
 */
export function watchKeyboard({ drive, tools, view, fit, chosen, time, undo, notifications, drivingByKeys }) {
  const help = () =>
    notifications.confirm(
      "Keys",
      el(
        "dl",
        { class: "keys" },
        ...WORDS.flatMap(([key, text]) => [el("dt", {}, el("kbd", {}, key)), el("dd", {}, text)]),
      ),
      [["Close", null]],
    );
  byId("keys").addEventListener("click", help);

  /** @type {Record<string, (event: KeyboardEvent) => unknown>} */
  const acts = {
    "+": () => view.zoom(1.25),
    "=": () => view.zoom(1.25),
    "-": () => view.zoom(0.8),
    "−": () => view.zoom(0.8),
    f: fit,
    l: () => view.setFollow(!view.follow),
    u: () => byId("units").click(),
    Delete: chosen.delete,
    Backspace: chosen.delete,
    p: chosen.pin,
    P: chosen.unpin,
    k: () => time.pause(),
    "?": help,
    A: (event) => event.shiftKey && drive.arm(), // and not where the capitals are locked
  };
  for (let n = 1; n <= 9; n++) acts[n] = () => tools.chooseNth(n);

  addEventListener(
    "keydown",
    (event) => {
      if (event.key !== " " || event.ctrlKey || event.metaKey || event.altKey || writesText(event.target)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) drive.halt();
    },
    { capture: true },
  );
  addEventListener(
    "keyup",
    (event) => {
      // or a focused button would be pressed
      if (event.key === " " && !writesText(event.target)) event.preventDefault();
    },
    { capture: true },
  );

  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || writesText(event.target)) return;
    const { target, key } = event;
    if ((event.ctrlKey || event.metaKey) && key.toLowerCase() === "z") {
      event.preventDefault();
      undo();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (key === "Enter" && target instanceof HTMLInputElement && target.type === "checkbox") {
      event.preventDefault();
      target.click();
      return;
    }
    if (target instanceof HTMLSelectElement) return; // letters and arrows choose there
    if (key === "Escape") notifications.close();
    if (drivingByKeys() && !event.shiftKey && "wasdWASD".includes(key)) return;
    const act = acts[key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
}
