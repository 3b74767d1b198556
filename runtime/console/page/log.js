// @ts-check
// The event log, newest first, filtered by level and text.

import { byId, el } from "./dom.js";

const LEVELS = ["debug", "info", "warning", "error"];
const SHOWN_MAX = 300;
/** @type {Record<string, string>} */
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
/** @param {string} event @param {Record<string, string>} fields */
export function sentence(event, fields) {
  const known = Object.fromEntries(Object.entries(fields).filter(([, value]) => !["", "None", "null"].includes(value)));
  // An event named as a field, as "mode", is described by that field.
  const { reason, [event]: what, ...others } = known;
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
/** @param {string} key @param {string} value */
function detail(key, value) {
  const [, unit] = UNITS.find(([end]) => key.endsWith(`_${end}`)) ?? [];
  const words = (unit === undefined ? key : key.slice(0, key.lastIndexOf("_"))).replaceAll("_", " ");
  if (value === "True") return words;
  if (value === "False") return `not ${words}`;
  if (value.startsWith(`${words} `)) return value;
  return `${words} ${value}${unit === undefined ? "" : ` ${unit}`}`;
}

// The time of day of a time stamp.
/** @param {string} t */
function when(t) {
  const time = /[T ](\d\d:\d\d:\d\d)/.exec(t);
  if (time === null) return "–";
  const moment = new Date(t);
  return Number.isNaN(moment.getTime()) ? time[1] : moment.toTimeString().slice(0, 8);
}

export class Log {
  /** @type {RunState} */
  #run;
  #list = byId("log");
  #level = byId("log-level");
  #filter = byId("log-filter");

  /** @param {RunState} run */
  constructor(run) {
    this.#run = run;
    run.on("log", (entry) => this.#add(entry));
    this.#level.addEventListener("change", () => this.#rebuild());
    this.#filter.addEventListener("input", () => this.#rebuild());
  }

  /** @param {LogMessage} entry */
  #matches({ level, event, fields }) {
    const found = LEVELS.indexOf(level),
      least = LEVELS.indexOf(this.#level.value);
    const text = this.#filter.value.trim().toLowerCase();
    return (
      (found < 0 || found >= least) && (text === "" || sentence(event, fields).join(" ").toLowerCase().includes(text))
    );
  }

  /** @param {LogMessage} entry */
  #add(entry) {
    if (!this.#matches(entry)) return;
    this.#list.prepend(this.#line(entry));
    while (this.#list.children.length > SHOWN_MAX) this.#list.lastElementChild?.remove();
  }

  #rebuild() {
    const lines = this.#run.log
      .filter((entry) => this.#matches(entry))
      .slice(-SHOWN_MAX)
      .reverse();
    this.#list.replaceChildren(...lines.map((entry) => this.#line(entry)));
  }

  /** @param {LogMessage} entry */
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
