// The plot panel: any number of a frame over time, a lane for each field, live and in playback. Reading a lane at a time:
// pointer or slider.

import { byId, download, el, setAttribute, setText } from "./dom.js";
import { History, numericFields } from "./history.js";
import { prefer, preferred } from "./preferences.js";
import { fitted } from "./theme.js";
import { isWall } from "./walls.js";

const LANES_MAX = 8;
const LEFT = 46;
const GAP_S = 2.5; // a line is broken where frames are missing
const LISTED_EVERY_MS = 1000;
const DEGREES = 180 / Math.PI;
// How a field is shown: the first rule whose pattern matches says unit and factor; lengths follow the page's units.
const RULES = [
  [/^(pose|localized\.(pose|frame)|objects\.\d+)\.[xy]$|^drive_request\.[xyv]$|^ranges\.|\.sigma$|way_m$|^twist\.v$/, "length", 1],
  [/heading$|theta$|^twist\.w$|^drive_request\.w$|^ring_yaw$|direction$/, "°", DEGREES],
  [/^phases\.|_us$/, "ms", 1e-3],
  [/^age\.|_s$|\.s$/, "s", 1],
  [/bytes$/, "MB", 1e-6],
];
const PER_SECOND = new Set(["twist.v", "twist.w", "drive_request.v", "drive_request.w"]);
const WORDS = [[/^twist\.v$/, "speed"], [/^twist\.w$/, "rate of turn"], [/^pose\.heading$/, "heading"], [/^ranges\./, "range "], [/^age\./, "age of range "],
  [/^phases\./, "phase "], [/^objects\./, "object "], [/^vectors\./, "vector "], [/_(us|s|m)$/, ""], [/[._]/g, " "]];

export const fieldName = (path) => WORDS.reduce((name, [pattern, word]) => name.replace(pattern, word), path);

export class Plots {
  #lanes = new Map(); // path → {element, canvas, value}
  #history = new History();
  #listed = { names: "", at_ms: -Infinity };
  #last = null;

  constructor({ run, units, theme, shown }) {
    Object.assign(this, { run, units, theme, shown });
    this.window = byId("plot-window");
    this.at = byId("plot-at");
    this.window.value = preferred("plot window", "30");
    this.window.addEventListener("change", () => {
      prefer("plot window", this.window.value);
      this.draw();
    });
    this.at.addEventListener("input", () => this.draw());
    byId("plot-filter").addEventListener("input", () => this.#list());
    byId("plot-save").addEventListener("click", () => this.#save());
    for (const path of preferred("plot fields", ["twist.v", "ranges.0"])) if (typeof path === "string") this.#addLane(path);
    run.on("session", () => run.watchesRecording && this.#history.clear());
    run.on("state", (state) => this.#take(state));
    units.on("changed", () => this.draw());
  }

  #take(state) {
    if (state === this.#last) return; // a report of the robot beside a recording
    const before = this.#last;
    const isOther = before !== null && (state.playback === null) !== (before.playback === null);
    if (isOther || (state.playback === null && before !== null && state.robot_s < before.robot_s)) this.#history.clear();
    this.#last = state;
    const walls = state.objects.filter(isWall).length;
    const counts = { segments: this.run.segments.size, objects: state.objects.length - walls, walls };
    this.#history.add(state.robot_s, { ...state, counts, clusters: null });
    const now = performance.now();
    if (this.shown() && now - this.#listed.at_ms > LISTED_EVERY_MS) {
      this.#listed.at_ms = now;
      this.#list();
    }
  }

  // The list of fields to choose from, made anew only when it has changed.
  #list() {
    const newest = this.#history.samples.at(-1)?.frame ?? {};
    const wanted = byId("plot-filter").value.trim().toLowerCase();
    const paths = [...new Set([...this.#lanes.keys(), ...numericFields(newest)])].filter((path) => wanted === "" || `${fieldName(path)} ${path}`.toLowerCase().includes(wanted));
    const names = paths.join();
    if (names === this.#listed.names) return;
    this.#listed.names = names;
    byId("plot-fields").replaceChildren(...paths.map((path) => {
      const box = el("input", { type: "checkbox", "data-path": path, onchange: () => this.#choose(path, box.checked) });
      box.checked = this.#lanes.has(path);
      return el("li", {}, el("label", {}, box, fieldName(path)));
    }));
    byId("plot-none").hidden = paths.length > 0;
  }

  #choose(path, on) {
    if (on) this.#addLane(path);
    else this.#removeLane(path);
    prefer("plot fields", [...this.#lanes.keys()]);
    this.draw();
  }

  #addLane(path) {
    if (this.#lanes.has(path)) return;
    if (this.#lanes.size >= LANES_MAX) this.#removeLane(this.#lanes.keys().next().value);
    const value = el("b"), canvas = el("canvas", { role: "img", "aria-label": fieldName(path) });
    const remove = el("button", { type: "button", class: "small", "aria-label": `Remove ${fieldName(path)}`, onclick: () => this.#choose(path, false) }, "✕");
    const element = el("figure", { class: "lane", "data-path": path }, el("figcaption", {}, el("span", {}, fieldName(path)), value, remove), canvas);
    canvas.addEventListener("pointermove", (event) => this.#readAt((event.offsetX - LEFT) / (canvas.clientWidth - LEFT)));
    canvas.addEventListener("pointerleave", () => this.#readAt(1));
    byId("plot-lanes").append(element);
    this.#lanes.set(path, { element, canvas, value });
    this.#tick(path, true);
  }

  #removeLane(path) {
    this.#lanes.get(path)?.element.remove();
    this.#lanes.delete(path);
    this.#tick(path, false);
  }

  #tick(path, on) {
    for (const box of byId("plot-fields").querySelectorAll("input")) if (box.dataset.path === path) box.checked = on;
  }

  #readAt(share) {
    this.at.value = String(Math.round(Number(this.at.max) * Math.max(0, Math.min(1, share))));
    this.draw();
  }

  // The time shown: up to the newest frame, in a recording around the present moment.
  get #span() {
    const long = Number(this.window.value), now = this.#last?.robot_s ?? 0;
    const newest = this.#history.samples.at(-1)?.t ?? now;
    const to = Math.min(newest, now + long / 2);
    return { from: to - long, to, now };
  }

  draw() {
    if (!this.shown()) return;
    const span = this.#span, share = Number(this.at.value) / Number(this.at.max);
    const read = share >= 1 ? span.now : span.from + share * (span.to - span.from);
    const back = read - span.now;
    const words = back === 0 ? "now" : `${Math.abs(back).toFixed(1)} s ${back < 0 ? "before" : "after"}`;
    setAttribute(this.at, "aria-valuetext", words);
    setText(byId("plot-read"), words);
    for (const [path, lane] of this.#lanes) this.#drawLane(path, lane, span, read);
  }

  #show(path) {
    const [, unit = "", factor = 1] = RULES.find(([pattern]) => pattern.test(path)) ?? [];
    const times = unit === "length" ? 1 / this.units.metres : factor;
    const name = (unit === "length" ? this.units.name : unit) + (PER_SECOND.has(path) ? "/s" : "");
    return { name, isAngle: unit === "°" && !PER_SECOND.has(path), scaled: (value) => (value === null || isSilence(path, value) ? null : value * times) };
  }

  #drawLane(path, { canvas, value }, { from, to, now }, read) {
    const { name, isAngle, scaled } = this.#show(path);
    const points = this.#history.series(path, from, to).map(([t, one]) => [t, scaled(one)]);
    const at = points.reduce((best, point) => (best === null || Math.abs(point[0] - read) < Math.abs(best[0] - read) ? point : best), null);
    setText(value, at === null || at[1] === null ? "none" : `${digits(at[1])} ${name}`.trim());
    const { ctx, width, height } = fitted(canvas);
    ctx.clearRect(0, 0, width, height);
    const known = points.filter(([, one]) => one !== null).map(([, one]) => one);
    const [low, high] = bounds(known);
    const x = (t) => LEFT + ((t - from) / (to - from)) * (width - LEFT - 2), y = (one) => height - 6 - ((one - low) / (high - low)) * (height - 14);
    this.#axes(ctx, width, y, known.length > 0 ? [low, (low + high) / 2, high] : []);
    ctx.strokeStyle = this.theme.accent;
    ctx.lineWidth = 1.6;
    ctx.lineJoin = "round";
    ctx.stroke(linePath(points, x, y, isAngle));
    ctx.strokeStyle = this.theme.ink;
    ctx.lineWidth = 1;
    for (const t of new Set([now < to ? now : null, read < to ? read : null])) {
      if (t === null) continue;
      ctx.setLineDash(t === now ? [] : [3, 3]);
      ctx.beginPath();
      ctx.moveTo(x(t), 0);
      ctx.lineTo(x(t), height);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    const range = known.length > 0 ? `${digits(Math.min(...known))} to ${digits(Math.max(...known))} ${name}` : "no value";
    setAttribute(canvas, "aria-label", `${fieldName(path)}: ${range} in ${Math.round(to - from)} s`);
  }

  #axes(ctx, width, y, marks) {
    ctx.font = this.theme.font(10.5);
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    ctx.lineWidth = 1;
    for (const mark of marks) {
      const at = Math.round(y(mark)) + 0.5;
      ctx.strokeStyle = this.theme.line;
      ctx.beginPath();
      ctx.moveTo(LEFT, at);
      ctx.lineTo(width, at);
      ctx.stroke();
      ctx.fillStyle = this.theme.muted;
      ctx.fillText(digits(mark), LEFT - 5, at);
    }
  }

  // What the lanes show as a table: a row a frame, SI units as on the wire.
  #save() {
    const { from, to } = this.#span, paths = [...this.#lanes.keys()];
    const columns = paths.map((path) => this.#history.series(path, from, to));
    const rows = (columns[0] ?? []).map(([t], i) => [t, ...columns.map((column, k) => inTable(paths[k], column[i][1]))].join());
    download("echolocate-plot.csv", new Blob([[["robot_s", ...paths].join(), ...rows, ""].join("\n")], { type: "text/csv" }));
  }
}

// No echo is −1 on the wire; in a table it is an empty cell, like all that is not known.
const inTable = (path, value) => (value === null || isSilence(path, value) ? "" : value);

const isSilence = (path, value) => path.startsWith("ranges.") && value < 0;

function linePath(points, x, y, isAngle) {
  const path = new Path2D();
  let before = null;
  for (const [t, value] of points) {
    const broken = before === null || value === null || t - before[0] > GAP_S || (isAngle && Math.abs(value - before[1]) > 180);
    if (value !== null && broken) path.moveTo(x(t), y(value));
    else if (value !== null) path.lineTo(x(t), y(value));
    before = value === null ? null : [t, value];
  }
  return path;
}

// A little more than the values take; a constant has room around it.
function bounds(values) {
  const low = Math.min(...values), high = Math.max(...values);
  if (values.length === 0) return [0, 1];
  return high > low ? [low - 0.04 * (high - low), high + 0.04 * (high - low)] : [low - 0.5, high + 0.5];
}

function digits(value) {
  const size = Math.abs(value);
  const text = size >= 1000 ? value.toFixed(0) : size >= 100 ? value.toFixed(1) : size >= 1 || size === 0 ? value.toFixed(2) : value.toPrecision(2);
  return (Number(text) === 0 ? "0" : text).replace("-", "−");
}
