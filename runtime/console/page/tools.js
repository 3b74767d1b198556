// @ts-check
// The map tools as a row of radio buttons, and the crosshair that stands in for the pointer when the keyboard is used.

import { button, byKey, el, icon, setAttribute } from "./dom.js";
import { prefer } from "./preferences.js";
import { drawCross } from "./tool_overlays.js";

const STEP_PX = 24;
const FINE_PX = 4;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Toolbox {
  /** @type {Map<string, HTMLButtonElement>} */
  #buttons = new Map();
  /** @type {Point | null} */
  #cross = null; // the crosshair, in metres
  /** @type {string | null} */
  #last = null; // a tool of the last visit that may not be used yet

  /** @param {Pick<Parts, "view" | "redraw"> & { box: HTMLElement; canvas: HTMLCanvasElement; tools: Tool[] }} parts */
  constructor({ box, canvas, tools, view, redraw }) {
    this.canvas = canvas;
    this.tools = tools;
    this.view = view;
    this.redraw = redraw;
    this.current = tools[0];
    tools.forEach((tool, index) => {
      const key = String(index + 1);
      const chooser = button([icon(tool.icon), el("kbd", { "aria-hidden": "true" }, key)], () => this.choose(tool.id), {
        role: "radio",
        id: `tool-${tool.id}`,
        title: `${tool.name} (${key})`,
        "aria-label": tool.name,
        "aria-keyshortcuts": key,
      });
      chooser.addEventListener("keydown", (event) => {
        const by = byKey(event, { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 });
        if (by === undefined) return;
        event.preventDefault();
        const shown = tools.filter((one) => this.#usable(one.id));
        const next = shown[(shown.indexOf(tool) + by + shown.length) % shown.length];
        this.choose(next.id);
        this.#buttons.get(next.id)?.focus();
      });
      this.#buttons.set(tool.id, chooser);
      box.append(chooser);
    });
    canvas.addEventListener("keydown", (event) => this.#key(event));
    canvas.addEventListener("blur", () => this.#setCross(null));
    canvas.addEventListener("pointerdown", () => this.#setCross(null));
    this.choose("pan", { kept: false });
  }

  /** @param {string} id */
  choose(id, { focus = false, kept = true } = {}) {
    const tool = this.tools.find((one) => one.id === id);
    if (tool !== undefined && tool !== this.current) {
      this.current.cancel?.();
      this.current.end?.();
      this.current = tool;
      tool.begin?.();
    }
    for (const [name, button] of this.#buttons) {
      setAttribute(button, "aria-checked", name === id);
      button.tabIndex = name === id ? 0 : -1;
    }
    setAttribute(this.canvas, "data-tool", id);
    if (kept) prefer("tool", id);
    if (focus) this.canvas.focus();
    this.redraw();
  }

  // Tools that send commands are for the page that controls a live run.
  /** @param {boolean} on */
  enable(on) {
    for (const { id, sends } of this.tools) {
      const button = this.#buttons.get(id);
      if (sends && button) button.disabled = !on;
    }
    if (!on && this.current.sends) this.choose("pan", { kept: false });
    else if (on && this.#last !== null && this.#usable(this.#last)) this.choose(this.#last);
    if (on) this.#last = null;
  }

  // The tool of the last visit, as soon as it may be used.
  /** @param {string} id */
  restore(id) {
    const tool = this.tools.find((one) => one.id === id);
    if (tool?.sends) this.#last = id;
    else if (tool) this.choose(id);
  }

  /** @param {string} id */
  #usable(id) {
    const button = this.#buttons.get(id);
    return button !== undefined && !button.hidden && !button.disabled;
  }

  /** @param {number} n */
  chooseNth(n) {
    const tool = this.tools[n - 1];
    if (tool !== undefined && this.#usable(tool.id)) this.choose(tool.id);
  }

  /** @param {Drawing} f */
  draw(f) {
    for (const tool of this.tools) tool.drawAlways?.(f);
    this.current.draw?.(f);
    if (this.#cross) drawCross(f, this.#cross);
  }

  /** @param {Point | null} cross */
  #setCross(cross) {
    if (this.#cross === null && cross === null) return;
    this.#cross = cross;
    this.redraw();
  }

  /** @param {KeyboardEvent} event @returns {Spot} */
  #spot(event) {
    this.#cross ??= { x: this.view.x, y: this.view.y };
    const [sx, sy] = this.view.toScreen(this.#cross.x, this.#cross.y);
    return { sx, sy, ...this.#cross, shift: event.shiftKey, touch: false };
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") {
      this.current.cancel?.();
      this.#setCross(null);
      this.current.none?.();
      this.redraw();
      return;
    }
    if (this.current.key?.(event, () => this.#spot(event))) {
      event.preventDefault();
      this.redraw();
      return;
    }
    const by = byKey(event, ARROWS);
    if (by) this.#arrow(event, by);
    else if (event.key === "Enter" && this.current.id !== "pan") {
      event.preventDefault();
      const at = this.#spot(event);
      this.#setCross({ x: at.x, y: at.y });
      if (this.current.press) this.current.press(at);
      else {
        this.current.down?.(at);
        this.current.up?.(at);
      }
      this.redraw();
    }
  }

  /** @param {KeyboardEvent} event @param {number[]} by */
  #arrow(event, [dx, dy]) {
    event.preventDefault();
    if (this.current.id === "pan") {
      this.view.pan(-dx * 2 * STEP_PX, -dy * 2 * STEP_PX);
      return;
    }
    const step = event.shiftKey ? FINE_PX : STEP_PX;
    const { sx, sy } = this.#spot(event);
    const tx = Math.max(0, Math.min(this.view.width, sx + dx * step)),
      ty = Math.max(0, Math.min(this.view.height, sy + dy * step));
    const [x, y] = this.view.toWorld(tx, ty);
    this.#setCross({ x, y });
    this.current.hover?.({ sx: tx, sy: ty, x, y, shift: event.shiftKey, touch: false });
  }
}
