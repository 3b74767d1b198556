// @ts-check
// The plot panel: any number of a frame over time, live and in playback: a lane for each field, or for two with an axis
// each. All lanes share a time axis. Reading a lane at a time: pointer or slider.

import { button, byId, download, el, setAttribute, setText } from "./dom.js";
import { History, numericFields } from "./history.js";
import { bounds, digits, FOOT, LEFT, linePath, timeAxis, valueAxis, valueMarks } from "./plot_draw.js";
import { difference, fieldName, isDerived, rateOf, seriesOf, shownAs } from "./plot_fields.js";
import { PlotTime } from "./plot_time.js";
import { prefer, preferred } from "./preferences.js";
import { fitted } from "./theme.js";
import { isWall } from "./walls.js";

const LANES_MAX = 8;
const RIGHT = 44; // of a second axis
const LISTED_EVERY_MS = 1000;
const SECOND = "&"; // between the two fields of a lane, as it is kept

export class Plots {
  /** @type {Map<string, Lane>} */
  #lanes = new Map(); // by the path of the left axis; `second` is that of the right one
  #history = new History();
  #listed = { names: "", at_ms: -Infinity };
  /** @type {Shown | null} */
  #last = null;
  #time = new PlotTime(() => this.draw());

  /** @param {Pick<Parts, "run" | "units" | "theme"> & { shown: () => boolean }} parts */
  constructor({ run, units, theme, shown }) {
    this.run = run;
    this.units = units;
    this.theme = theme;
    this.shown = shown;
    this.window = byId("plot-window");
    this.at = byId("plot-at");
    this.window.value = preferred("plot window", "30");
    this.window.addEventListener("change", () => {
      prefer("plot window", this.window.value);
      this.#time.follow();
    });
    this.at.addEventListener("input", () => this.draw());
    byId("plot-filter").addEventListener("input", () => this.#list());
    byId("plot-save").addEventListener("click", () => this.#save());
    const acts = {
      "plot-in": () => this.#time.zoom(this.#span, 0.5),
      "plot-out": () => this.#time.zoom(this.#span, 2),
      "plot-earlier": () => this.#move(-0.25),
      "plot-later": () => this.#move(0.25),
      "plot-follow": () => this.#time.follow(),
    };
    for (const [id, act] of Object.entries(acts)) byId(id).addEventListener("click", act);
    for (const lane of preferred("plot fields", ["twist.v", "ranges.0"]))
      if (typeof lane === "string") this.#addLane(lane.split(SECOND)[0], lane.split(SECOND)[1] ?? null);
    run.on("session", () => run.watchesRecording && this.#history.clear());
    run.on("history", (samples) => {
      for (const sample of samples) this.#history.add(sample.robot_s, sample);
    });
    run.on("state", (state) => this.#take(state));
    units.on("changed", () => this.draw());
  }

  /** @param {Shown} state */
  #take(state) {
    if (state === this.#last) return; // a report of the robot beside a recording
    const before = this.#last;
    const isOther = before !== null && (state.playback === null) !== (before.playback === null);
    if (isOther || (state.playback === null && before !== null && state.robot_s < before.robot_s))
      this.#history.clear();
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
    const paths = [...new Set([...this.#fields, ...numericFields(newest)])].filter(
      (path) => wanted === "" || `${fieldName(path)} ${path}`.toLowerCase().includes(wanted),
    );
    const names = paths.join();
    if (names === this.#listed.names) return;
    this.#listed.names = names;
    byId("plot-fields").replaceChildren(
      ...paths.map((path) => {
        const box = el("input", {
          type: "checkbox",
          "data-path": path,
          onchange: () => {
            this.#choose(path, box.checked);
          },
        });
        box.checked = this.#fields.includes(path);
        return el("li", {}, el("label", {}, box, fieldName(path)));
      }),
    );
    byId("plot-none").hidden = paths.length > 0;
  }

  get #fields() {
    return [...this.#lanes].flatMap(([path, { second }]) => (second === null ? [path] : [path, second]));
  }

  /** @param {number} share */
  #move(share) {
    const { from, to } = this.#span;
    this.#time.pan({ from, to }, share * (to - from));
  }

  /** @param {string} path @param {boolean} on */
  #choose(path, on) {
    if (on) this.#addLane(path);
    else this.#remove(path);
    this.#keep();
  }

  #keep() {
    prefer(
      "plot fields",
      [...this.#lanes].map(([path, { second }]) => (second === null ? path : `${path}${SECOND}${second}`)),
    );
    for (const [path, lane] of this.#lanes) this.#offerCombinations(path, lane);
    this.draw();
  }

  /** @param {string} path @param {string | null} second */
  #addLane(path, second = null) {
    if (this.#fields.includes(path)) return;
    const [oldest] = this.#lanes.keys();
    if (this.#lanes.size >= LANES_MAX) this.#remove(oldest);
    const value = el("b"),
      canvas = el("canvas", { role: "img", "aria-label": fieldName(path) }),
      name = el("span", {}, fieldName(path));
    const combine = el("select", {
      class: "combine",
      "aria-label": `Combine ${fieldName(path)}`,
      title: "A second axis, the rate, or a difference",
      onchange: () => {
        this.#combine(path, combine.value);
      },
    });
    const more = { class: "small", "aria-label": `Remove ${fieldName(path)}` };
    const remove = button("✕", () => this.#choose(path, false), more);
    const element = el(
      "figure",
      { class: "lane", "data-path": path },
      el("figcaption", {}, name, value, combine, remove),
      canvas,
    );
    canvas.addEventListener(
      "pointermove",
      (event) => event.buttons === 0 && this.#readAt((event.offsetX - LEFT) / (canvas.clientWidth - this.#margins)),
    );
    canvas.addEventListener("pointerleave", () => this.#readAt(1));
    this.#time.watch(canvas, () => this.#span, LEFT);
    byId("plot-lanes").append(element);
    this.#lanes.set(path, { element, canvas, name, value, combine, second: null });
    this.#tick(path, true);
    if (second !== null) this.#setSecond(path, second);
    for (const [one, lane] of this.#lanes) this.#offerCombinations(one, lane);
  }

  // What a lane can be combined with: the fields of the other lanes. What is derived is not derived from again.
  /** @param {string} path @param {Lane} lane */
  #offerCombinations(path, { combine, second }) {
    const others = [...this.#lanes]
      .filter(([other, lane]) => other !== path && lane.second === null)
      .map(([other]) => other);
    const { name } = shownAs(path, this.units); // values of two units have no difference
    const plain = others.filter((one) => !isDerived(one) && !isDerived(path) && shownAs(one, this.units).name === name);
    const options = [
      ["", "combine…"],
      ...(isDerived(path) ? [] : [["rate", "its rate"]]),
      ...(second === null
        ? others.map((one) => [`axis ${one}`, `${fieldName(one)} on the right`])
        : [["apart", `${fieldName(second)} apart`]]),
      ...plain.map((one) => [`minus ${one}`, `minus ${fieldName(one)}`]),
    ];
    combine.replaceChildren(...options.map(([value, text]) => el("option", { value }, text)));
  }

  /** @param {string} path @param {string} what */
  #combine(path, what) {
    const [kind, other] = [what.split(" ")[0], what.slice(what.indexOf(" ") + 1)];
    const second = this.#lanes.get(path)?.second ?? null;
    if (kind === "rate") this.#addLane(rateOf(path));
    else if (kind === "minus") this.#addLane(difference(path, other));
    else if (kind === "axis") {
      this.#remove(other);
      this.#setSecond(path, other);
    } else if (kind === "apart" && second !== null) {
      this.#setSecond(path, null);
      this.#addLane(second);
    }
    this.#keep();
  }

  /** @param {string} path @param {string | null} second */
  #setSecond(path, second) {
    const lane = this.#lanes.get(path);
    if (lane === undefined) return;
    if (lane.second !== null) this.#tick(lane.second, false);
    lane.second = second;
    if (second !== null) this.#tick(second, true);
    setText(lane.name, second === null ? fieldName(path) : `${fieldName(path)}, ${fieldName(second)} (right)`);
  }

  // Removes a field, and its lane if it is the one of the left axis.
  /** @param {string} path */
  #remove(path) {
    for (const [left, { second }] of this.#lanes) if (second === path) this.#setSecond(left, null);
    const lane = this.#lanes.get(path);
    if (lane === undefined) return;
    if (lane.second !== null) this.#tick(lane.second, false);
    lane.element.remove();
    this.#lanes.delete(path);
    this.#tick(path, false);
  }

  /** @param {string} path @param {boolean} on */
  #tick(path, on) {
    for (const box of byId("plot-fields").querySelectorAll("input")) if (box.dataset.path === path) box.checked = on;
  }

  /** @param {number} share */
  #readAt(share) {
    this.at.value = String(Math.round(Number(this.at.max) * Math.max(0, Math.min(1, share))));
    this.draw();
  }

  get #span() {
    const now = this.#last?.robot_s ?? 0;
    return this.#time.span({ long: Number(this.window.value), now, newest: this.#history.samples.at(-1)?.t ?? now });
  }

  // What the axes take of a lane's width, px: the same of all lanes, so that equal times are below one another.
  get #margins() {
    return LEFT + ([...this.#lanes.values()].some(({ second }) => second !== null) ? RIGHT : 2);
  }

  draw() {
    if (!this.shown()) return;
    const span = this.#span,
      share = Number(this.at.value) / Number(this.at.max);
    const read = share >= 1 && !this.#time.isHeld ? span.now : span.from + share * (span.to - span.from);
    const back = read - span.now;
    const words = back === 0 ? "now" : `${Math.abs(back).toFixed(1)} s ${back < 0 ? "before" : "after"}`;
    setAttribute(this.at, "aria-valuetext", words);
    setText(byId("plot-read"), words);
    setAttribute(byId("plot-follow"), "aria-pressed", !this.#time.isHeld);
    const margins = this.#margins;
    for (const [path, lane] of this.#lanes) this.#drawLane(path, lane, span, read, margins);
  }

  /** @param {string} path @param {Span} span @returns {TimedValue[]} */
  #points(path, { from, to }) {
    const { factor, isAngle } = shownAs(path, this.units);
    /** @param {number} one */
    const within = (one) => (isAngle ? one - 360 * Math.round(one / 360) : one); // the robot may have turned often
    return seriesOf(this.#history, path, from, to).map(([t, one]) => [t, one === null ? null : within(one * factor)]);
  }

  /** @param {string} path @param {Lane} lane @param {Span} span @param {number} read @param {number} margins */
  #drawLane(path, { canvas, value, second }, span, read, margins) {
    const { from, to, now } = span,
      { ctx, width, height } = fitted(canvas);
    ctx.clearRect(0, 0, width, height);
    /** @param {number} t */
    const x = (t) => LEFT + ((t - from) / (to - from)) * (width - margins);
    timeAxis(ctx, this.theme, span, x, height);
    /** @type {Array<[string, string, number[]]>} */
    const curves = [[path, this.theme.accent, []]];
    if (second !== null) curves.push([second, this.theme.segment, [5, 3]]);
    const words = curves.map(([of, colour, dash], i) => {
      const points = this.#points(of, span),
        { name, isAngle } = shownAs(of, this.units);
      const known = points.map(([, one]) => one).filter((one) => one !== null);
      const [low, high] = bounds(known);
      /** @param {number} one */
      const y = (one) => height - FOOT - 4 - ((one - low) / (high - low)) * (height - FOOT - 12);
      valueAxis(ctx, this.theme, y, known.length > 0 ? valueMarks(low, high) : [], {
        right: i === 1,
        width: width - margins + LEFT,
        colour,
      });
      ctx.strokeStyle = colour;
      ctx.lineWidth = 1.6;
      ctx.lineJoin = "round";
      ctx.setLineDash(dash);
      ctx.save();
      ctx.beginPath();
      ctx.rect(LEFT, 0, width - margins, height);
      ctx.clip();
      ctx.stroke(linePath(points, x, y, isAngle));
      ctx.restore();
      ctx.setLineDash([]);
      const at = points.reduce(
        (best, point) => (best === null || Math.abs(point[0] - read) < Math.abs(best[0] - read) ? point : best),
        /** @type {TimedValue | null} */ (null),
      );
      const range =
        known.length > 0 ? `${digits(Math.min(...known))} to ${digits(Math.max(...known))} ${name}` : "no value";
      return {
        read: at === null || at[1] === null ? "none" : `${digits(at[1])} ${name}`.trim(),
        range: `${fieldName(of)}: ${range}`,
      };
    });
    setText(value, words.map((one) => one.read).join(", "));
    ctx.strokeStyle = this.theme.ink;
    ctx.lineWidth = 1;
    for (const t of new Set([now < to && now > from ? now : null, read < to ? read : null])) {
      if (t === null) continue;
      ctx.setLineDash(t === now ? [] : [3, 3]);
      ctx.beginPath();
      ctx.moveTo(x(t), 0);
      ctx.lineTo(x(t), height - FOOT);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    setAttribute(
      canvas,
      "aria-label",
      `${words.map(({ range }) => range).join("; ")} in ${Number((to - from).toFixed(to - from < 10 ? 1 : 0))} s`,
    );
  }

  // What the lanes show as a table: a row a frame, SI units as on the wire.
  #save() {
    const { from, to } = this.#span,
      paths = this.#fields;
    const columns = paths.map((path) => seriesOf(this.#history, path, from, to));
    const rows = (columns[0] ?? []).map(([t], i) =>
      [Number(t.toFixed(6)), ...columns.map((column) => column[i][1] ?? "")].join(),
    );
    download(
      "echolocate-plot.csv",
      new Blob([[["robot_s", ...paths].join(), ...rows, ""].join("\n")], { type: "text/csv" }),
    );
  }
}
