// The map tools as a row of radio buttons, and the crosshair that stands in for the pointer when the keyboard is used.

import { el, icon, setAttribute } from "./dom.js";
import { prefer } from "./preferences.js";
import { drawCross } from "./tool_overlays.js";

const STEP_PX = 24;
const FINE_PX = 4;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Toolbox {
  #buttons = new Map();
  #cross = null; // the crosshair, in metres
  #last = null; // a tool of the last visit that may not be used yet

  // `tools` is a list of {id, name, icon, sends, down, move, up, cancel, hover, key, draw, begin, end}.
  constructor({ box, canvas, tools, view, redraw }) {
    Object.assign(this, { canvas, tools, view, redraw });
    tools.forEach((tool, index) => {
      const button = el(
        "button",
        {
          type: "button",
          role: "radio",
          id: `tool-${tool.id}`,
          title: `${tool.name} (${index + 1})`,
          "aria-label": tool.name,
          "aria-keyshortcuts": String(index + 1),
          onclick: () => this.choose(tool.id),
        },
        icon(tool.icon),
        el("kbd", { "aria-hidden": "true" }, String(index + 1)),
      );
      button.addEventListener("keydown", (event) => {
        const by = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
        if (by === undefined) return;
        event.preventDefault();
        const shown = tools.filter((one) => this.#usable(one));
        const next = shown[(shown.indexOf(tool) + by + shown.length) % shown.length];
        this.choose(next.id);
        this.#buttons.get(next.id).focus();
      });
      this.#buttons.set(tool.id, button);
      box.append(button);
    });
    canvas.addEventListener("keydown", (event) => this.#key(event));
    canvas.addEventListener("blur", () => this.#setCross(null));
    canvas.addEventListener("pointerdown", () => this.#setCross(null));
    this.choose("pan", { kept: false });
  }

  choose(id, { focus = false, kept = true } = {}) {
    const tool = this.tools.find((one) => one.id === id);
    if (tool !== this.current) {
      this.current?.cancel?.();
      this.current?.end?.();
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
  enable(on) {
    for (const tool of this.tools) if (tool.sends) this.#buttons.get(tool.id).disabled = !on;
    if (!on && this.current.sends) this.choose("pan", { kept: false });
    else if (on && this.#usable(this.tools.find(({ id }) => id === this.#last))) this.choose(this.#last);
    if (on) this.#last = null;
  }

  // The tool of the last visit, as soon as it may be used.
  restore(id) {
    const tool = this.tools.find((one) => one.id === id);
    if (tool?.sends) this.#last = id;
    else if (tool) this.choose(id);
  }

  #usable(tool) {
    const button = this.#buttons.get(tool?.id);
    return button !== undefined && !button.hidden && !button.disabled;
  }

  chooseNth(n) {
    const tool = this.tools[n - 1];
    if (this.#usable(tool)) this.choose(tool.id);
  }

  draw(f) {
    for (const tool of this.tools) tool.drawAlways?.(f);
    this.current.draw?.(f);
    if (this.#cross) drawCross(f, this.#cross);
  }

  #setCross(cross) {
    if (this.#cross === null && cross === null) return;
    this.#cross = cross;
    this.redraw();
  }

  #spot(event) {
    this.#cross ??= { x: this.view.x, y: this.view.y };
    const [sx, sy] = this.view.toScreen(this.#cross.x, this.#cross.y);
    return { sx, sy, ...this.#cross, shift: event.shiftKey, touch: false };
  }

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
    const by = ARROWS[event.key];
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
