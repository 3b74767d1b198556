// The event log, newest first, filtered by level and text.

import { byId, el } from "./dom.js";

const LEVELS = ["debug", "info", "warning", "error"];
const SHOWN_MAX = 300;
const MARKS = { debug: "·", info: "○", warning: "▲", error: "■" };

const formatFields = (fields) => Object.entries(fields ?? {}).map(([key, value]) =>
  `${key}=${typeof value === "object" ? JSON.stringify(value) : value}`).join(" ").slice(0, 600);

// Seconds of the run, or the time of day of a log time stamp.
function when(t) {
  if (typeof t === "number") return `${t.toFixed(1)} s`;
  const time = /[T ](\d\d:\d\d:\d\d)/.exec(String(t));
  if (time === null) return "–";
  const moment = new Date(t);
  return Number.isNaN(moment.getTime()) ? time[1] : moment.toTimeString().slice(0, 8);
}

export class Log {
  #run;
  #list = byId("log");
  #level = byId("log-level");
  #filter = byId("log-filter");

  constructor(run) {
    this.#run = run;
    run.on("log", (entry) => this.#add(entry));
    this.#level.addEventListener("change", () => this.#rebuild());
    this.#filter.addEventListener("input", () => this.#rebuild());
  }

  #matches({ level, event, fields }) {
    const found = LEVELS.indexOf(level), least = LEVELS.indexOf(this.#level.value);
    const text = this.#filter.value.trim().toLowerCase();
    return (found < 0 || found >= least) && (text === "" || `${event} ${formatFields(fields)}`.toLowerCase().includes(text));
  }

  #add(entry) {
    if (!this.#matches(entry)) return;
    this.#list.prepend(this.#line(entry));
    while (this.#list.children.length > SHOWN_MAX) this.#list.lastChild.remove();
  }

  #rebuild() {
    const lines = this.#run.log.filter((entry) => this.#matches(entry)).slice(-SHOWN_MAX).reverse();
    this.#list.replaceChildren(...lines.map((entry) => this.#line(entry)));
  }

  #line({ timestamp, level, event, fields }) {
    return el("li", { "data-level": level },
      el("span", {}, when(timestamp)),
      el("span", { class: "level" }, `${MARKS[level] ?? "○"} ${level}`),
      el("span", {}, `${event} `, el("span", { class: "more" }, formatFields(fields))));
  }
}
