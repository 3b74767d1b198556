// @ts-check
// Strip charts: the duration of each phase of the last cycles, stacked, against budget and period, and their lateness.
// A late or missed cycle also has a mark above its column, because colour alone is not enough for every reader.

import { byId, el, setAttribute, setText } from "./dom.js";
import { addCross } from "./scene.js";
import { context, fitted } from "./theme.js";

const COLUMN_PX = 3;
const LEFT = 34;
const TOP = 14;
const BOTTOM = 4;
/** @type {Record<string, string>} */
const ENDS = {
  budget: "no time left",
  quota: "quota used",
  converged: "nothing left to improve",
  nothing: "nothing to refine",
};
const TOPS_MS = [0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

class Strip {
  top_ms = 1;
  per_ms = 1;
  width = 1;
  floor = 1;

  /** @param {HTMLCanvasElement} canvas @param {Theme} theme */
  constructor(canvas, theme) {
    this.canvas = canvas;
    this.ctx = context(canvas);
    this.theme = theme;
  }

  /** @param {number} highest */
  begin(highest) {
    const { ctx, width, height } = fitted(this.canvas);
    ctx.clearRect(0, 0, width, height);
    this.top_ms = TOPS_MS.find((top) => top >= highest) ?? highest;
    this.width = width;
    this.floor = height - BOTTOM;
    this.per_ms = (height - TOP - BOTTOM) / this.top_ms;
    ctx.font = this.theme.font(10.5);
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    for (const share of [0, 0.5, 1]) {
      const y = Math.round(this.y(share * this.top_ms)) + 0.5;
      ctx.strokeStyle = this.theme.line;
      ctx.lineWidth = 1;
      ctx.beginPath();
      ctx.moveTo(LEFT, y);
      ctx.lineTo(width, y);
      ctx.stroke();
      ctx.fillStyle = this.theme.muted;
      ctx.fillText(String(Number((share * this.top_ms).toPrecision(2))), LEFT - 5, y);
    }
  }

  /** @param {number} ms */
  y(ms) {
    return this.floor - Math.min(ms, this.top_ms) * this.per_ms;
  }

  /** @param {number} index @param {number} count */
  x(index, count) {
    return this.width - 3 - (count - index) * COLUMN_PX;
  }

  /** @param {number} ms @param {string} text @param {number[]} dash */
  line(ms, text, dash) {
    if (!(ms > 0) || ms > this.top_ms) return;
    const { ctx } = this,
      y = this.y(ms);
    ctx.strokeStyle = this.theme.ink;
    ctx.setLineDash(dash);
    ctx.lineWidth = 1.4;
    ctx.beginPath();
    ctx.moveTo(LEFT, y);
    ctx.lineTo(this.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.font = this.theme.font(10.5, 600);
    ctx.textAlign = "left";
    ctx.textBaseline = "bottom";
    ctx.lineWidth = 3;
    ctx.strokeStyle = this.theme.panel;
    ctx.strokeText(text, LEFT + 4, y - 1);
    ctx.fillStyle = this.theme.ink;
    ctx.fillText(text, LEFT + 4, y - 1);
  }

  // Crosses where a cycle was missed, triangles where one was late.
  /** @param {Column[]} shown */
  marks(shown) {
    const crosses = new Path2D(),
      triangles = new Path2D();
    shown.forEach(({ missed, late }, i) => {
      const x = this.x(i, shown.length) + COLUMN_PX / 2;
      if (missed > 0) {
        addCross(crosses, x, 6, 4);
      } else if (late > 0) {
        triangles.moveTo(x - 4, 3);
        triangles.lineTo(x + 4, 3);
        triangles.lineTo(x, 10);
        triangles.closePath();
      }
    });
    this.ctx.strokeStyle = this.theme.stop;
    this.ctx.lineWidth = 2;
    this.ctx.stroke(crosses);
    this.ctx.fillStyle = this.theme.warning;
    this.ctx.fill(triangles);
  }
}

export class Charts {
  #names = /** @type {string[] | null} */ (null);
  #values = /** @type {HTMLElement[]} */ ([]);

  /** @param {Pick<Parts, "run" | "theme">} parts */
  constructor({ run, theme }) {
    this.run = run;
    this.theme = theme;
    this.phases = new Strip(byId("phases"), theme);
    this.late = new Strip(byId("late"), theme);
  }

  draw() {
    if (this.phases.canvas.clientWidth === 0) return;
    const chart = this.run.chart;
    this.#drawPhases(chart);
    this.#drawLate(chart);
  }

  /** @param {Column[]} chart */
  #drawPhases(chart) {
    const strip = this.phases;
    const names = Object.keys(this.run.state.phases);
    const budget = 1000 * (this.run.session?.budget_s ?? 0),
      period = 1000 * (this.run.session?.period_s ?? 0);
    const shownMax = Math.floor((strip.canvas.clientWidth - LEFT - 6) / COLUMN_PX);
    const shown = chart.slice(-Math.max(1, shownMax));
    const sums = shown.map(({ phases }) => names.reduce((sum, name) => sum + (phases[name] ?? 0) / 1000, 0));
    strip.begin(Math.max(1.25 * budget, ...sums));
    const base = new Float64Array(shown.length);
    names.forEach((name, k) => {
      const path = new Path2D();
      shown.forEach(({ phases }, i) => {
        const ms = (phases[name] ?? 0) / 1000;
        const from = strip.y(base[i]),
          to = strip.y(base[i] + ms);
        base[i] += ms;
        if (from - to > 0.2) path.rect(strip.x(i, shown.length), to, COLUMN_PX - 0.5, from - to);
      });
      strip.ctx.fillStyle = this.theme.phases[k % 6];
      strip.ctx.fill(path);
    });
    strip.line(budget, `budget ${Number(budget.toPrecision(3))} ms`, [6, 4]);
    strip.line(period, `period ${Number(period.toPrecision(3))} ms`, []);
    strip.marks(shown);
    this.#updateLegend(names, shown.at(-1)?.phases ?? {});
  }

  /** @param {string[]} names @param {Record<string, number>} phases */
  #updateLegend(names, phases) {
    if (names.join() !== this.#names?.join()) {
      this.#names = names;
      this.#values = names.map(() => el("b"));
      byId("phases-legend").replaceChildren(
        ...names.map((name, k) => {
          const swatch = el("i");
          swatch.style.background = `var(--phase-${k % 6})`;
          return el("span", {}, swatch, `${name} `, this.#values[k]);
        }),
        el("span", {}, names.length > 0 ? "✕ missed  ▼ late" : "not recorded"),
      );
    }
    names.forEach((name, k) => setText(this.#values[k], ((phases[name] ?? 0) / 1000).toFixed(2)));
  }

  /** @param {Column[]} chart */
  #drawLate(chart) {
    const strip = this.late;
    const shown = chart.slice(-Math.max(1, Math.floor((strip.canvas.clientWidth - LEFT - 6) / COLUMN_PX)));
    strip.begin(Math.max(0.2, ...shown.map(({ late_ms }) => late_ms)));
    const path = new Path2D();
    shown.forEach(({ late_ms }, i) => {
      const y = strip.y(Math.max(0, late_ms));
      path.rect(strip.x(i, shown.length), y, COLUMN_PX - 0.5, Math.max(0.6, strip.floor - y));
    });
    strip.ctx.fillStyle = this.theme.accent;
    strip.ctx.fill(path);
    strip.marks(shown);
    const { missed, late, quanta, refinement } = this.run.state;
    const counts = missed === null ? "not recorded" : `${missed} missed, ${late} late`;
    setText(byId("late-legend"), `${counts}; ${quanta} steps of refinement, then ${ENDS[refinement] ?? "–"}`);
    const last = shown.at(-1);
    if (last && shown.length % 20 === 0) {
      setAttribute(
        strip.canvas,
        "aria-label",
        `Lateness of the last ${shown.length} cycles, the last one ${last.late_ms.toFixed(2)} ms`,
      );
    }
  }
}
