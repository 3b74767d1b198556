// The event log, newest first, with a filter by level and by words.

import { byId, el } from "./dom.js";

const LEVELS = ["debug", "info", "warning", "error"];
const SHOWN_MAX = 300;
const MARKS = { debug: "·", info: "○", warning: "▲", error: "■" };

const told = (fields) => Object.entries(fields ?? {}).map(([key, value]) =>
  `${key}=${typeof value === "object" ? JSON.stringify(value) : value}`).join(" ").slice(0, 600);

// Seconds of a run, or a moment as the log writes it: of that the time of day.
function when(t) {
  if (typeof t === "number") return `${t.toFixed(1)} s`;
  const time = /[T ](\d\d:\d\d:\d\d)/.exec(String(t));
  if (time === null) return "–";
  const moment = new Date(t);
  return Number.isNaN(moment.getTime()) ? time[1] : moment.toTimeString().slice(0, 8);
}

export class Log {
  #world;
  #list = byId("log");
  #level = byId("log-level");
  #filter = byId("log-filter");

  constructor(world) {
    this.#world = world;
    world.on("log", (entry) => this.#add(entry));
    this.#level.addEventListener("change", () => this.#again());
    this.#filter.addEventListener("input", () => this.#again());
  }

  #wanted({ level, event, fields }) {
    const found = LEVELS.indexOf(level), least = LEVELS.indexOf(this.#level.value);
    const words = this.#filter.value.trim().toLowerCase();
    return (found < 0 || found >= least) && (words === "" || `${event} ${told(fields)}`.toLowerCase().includes(words));
  }

  #add(entry) {
    if (!this.#wanted(entry)) return;
    this.#list.prepend(this.#line(entry));
    while (this.#list.children.length > SHOWN_MAX) this.#list.lastChild.remove();
  }

  #again() {
    const lines = this.#world.log.filter((entry) => this.#wanted(entry)).slice(-SHOWN_MAX).reverse();
    this.#list.replaceChildren(...lines.map((entry) => this.#line(entry)));
  }

  #line({ timestamp, level, event, fields }) {
    return el("li", { "data-level": level },
      el("span", {}, when(timestamp)),
      el("span", { class: "level" }, `${MARKS[level] ?? "○"} ${level}`),
      el("span", {}, `${event} `, el("span", { class: "more" }, told(fields))));
  }
}
