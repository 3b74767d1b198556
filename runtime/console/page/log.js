// The event log, newest first, filtered by level and text.

import { byId, el } from "./dom.js";

const LEVELS = ["debug", "info", "warning", "error"];
const SHOWN_MAX = 300;
const MARKS = { debug: "·", info: "○", warning: "▲", error: "■" };

const DETAILS_MAX = 600;
const UNITS = [
  ["us", "µs"],
  ["ms", "ms"],
  ["s", "s"],
  ["m", "m"],
  ["rad", "rad"],
  ["bytes", "bytes"],
  ["hz", "Hz"],
];

// A line of the log as a sentence: what happened, why, and in brackets what else is known of it.
export function sentence(event, fields) {
  const known = Object.fromEntries(
    Object.entries(fields ?? {}).filter(([, value]) => !["", "None", "null"].includes(String(value))),
  );
  const { reason, [event]: what, ...others } = known; // an event named as a field, as "mode", is described by that field
  const head = what === undefined ? event : `${event} ${what}`;
  const text = `${head.charAt(0).toUpperCase()}${head.slice(1)}${reason === undefined ? "" : `: ${reason}`}`;
  const details = Object.entries(others)
    .map(([key, value]) => detail(key, value))
    .join(", ");
  return [
    /[.!?]$/.test(text) || details !== "" ? text : `${text}.`,
    details === "" ? "" : `(${details.slice(0, DETAILS_MAX)})`,
  ];
}

// "took_s", 1.5 as "took 1.5 s"; a flag is named alone.
function detail(key, value) {
  const shown = typeof value === "object" ? JSON.stringify(value) : String(value);
  const [, unit] = UNITS.find(([end]) => key.endsWith(`_${end}`)) ?? [];
  const words = (unit === undefined ? key : key.slice(0, key.lastIndexOf("_"))).replaceAll("_", " ");
  if (shown === "True" || shown === "true") return words;
  if (shown === "False" || shown === "false") return `not ${words}`;
  if (shown.startsWith(`${words} `)) return shown;
  return `${words} ${shown}${unit === undefined ? "" : ` ${unit}`}`;
}

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
    const found = LEVELS.indexOf(level),
      least = LEVELS.indexOf(this.#level.value);
    const text = this.#filter.value.trim().toLowerCase();
    return (
      (found < 0 || found >= least) && (text === "" || sentence(event, fields).join(" ").toLowerCase().includes(text))
    );
  }

  #add(entry) {
    if (!this.#matches(entry)) return;
    this.#list.prepend(this.#line(entry));
    while (this.#list.children.length > SHOWN_MAX) this.#list.lastChild.remove();
  }

  #rebuild() {
    const lines = this.#run.log
      .filter((entry) => this.#matches(entry))
      .slice(-SHOWN_MAX)
      .reverse();
    this.#list.replaceChildren(...lines.map((entry) => this.#line(entry)));
  }

  #line({ timestamp, level, event, fields }) {
    const [text, details] = sentence(event, fields);
    return el(
      "li",
      { "data-level": level },
      el("span", {}, when(timestamp)),
      el("span", { class: "level" }, `${MARKS[level] ?? "○"} ${level}`),
      el("span", {}, `${text} `, el("span", { class: "more" }, details)),
    );
  }
}
