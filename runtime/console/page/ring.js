// @ts-check
// The ring with a sector for each sensor, as long as its range. An empty rim: no echo; a cross: not trusted; nothing:
// never fired. The outline is bold while the sensor fires.

import { byId, setText } from "./dom.js";
import { addCross, addHeading } from "./scene.js";
import { fitted } from "./theme.js";

const OLD_S = 1;

export class Ring {
  /** @param {Pick<Parts, "run" | "theme" | "units">} parts */
  constructor({ run, theme, units }) {
    this.run = run;
    this.theme = theme;
    this.units = units;
  }

  draw() {
    const canvas = byId("ring");
    if (canvas.clientWidth === 0) return;
    const run = this.run,
      theme = this.theme,
      ring = run.session?.ring;
    const { ctx, width, height } = fitted(canvas);
    ctx.clearRect(0, 0, width, height);
    if (!ring || !run.fresh) return;
    const { ranges, age, firing, sensors, pose } = run.state;
    const cx = width / 2,
      cy = height / 2;
    const rim = Math.min(width, height) / 2 - 15;
    // What is near matters most: along a radius goes the square root of the range.
    /** @param {number} range */
    const reach = (range) => rim * Math.sqrt(Math.min(1, Math.max(0, range) / ring.range_max));
    const half = Math.min(ring.half_angle, Math.PI / Math.max(ring.mounts.length, 1)) * 0.94;
    const faulty = new Set(sensors.map(([index]) => index));
    const fires = new Set(firing);

    ctx.strokeStyle = theme.line;
    ctx.lineWidth = 1;
    for (const range of [1, 3, 10, 30]
      .map((step) => step * this.units.metres)
      .filter((step) => step < ring.range_max)
      .concat(ring.range_max)) {
      ctx.beginPath();
      ctx.arc(cx, cy, reach(range), 0, 2 * Math.PI);
      ctx.stroke();
    }
    const fresh = new Path2D(),
      old = new Path2D(),
      firesNow = new Path2D(),
      silent = new Path2D(),
      crosses = new Path2D();
    let nearest = /** @type {{ range: number; index: number } | null} */ (null);
    ctx.font = theme.font(9.5, 600);
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    ring.mounts.forEach(([, , angle], index) => {
      const at = -(run.yaw(index) + angle); // the screen's y looks down
      const range = ranges[index];
      if (fires.has(index)) {
        firesNow.moveTo(cx, cy);
        firesNow.arc(cx, cy, range !== null && range >= 0 ? Math.max(2, reach(range)) : rim, at - half, at + half);
        firesNow.closePath();
      }
      if (faulty.has(index)) {
        const x = cx + 0.88 * rim * Math.cos(at),
          y = cy + 0.88 * rim * Math.sin(at);
        addCross(crosses, x, y, 4);
      }
      ctx.fillStyle = fires.has(index) ? theme.ink : theme.muted;
      ctx.fillText(String(index), cx + (rim + 8) * Math.cos(at), cy + (rim + 8) * Math.sin(at));
      if (range === null || range === undefined) return;
      if (range < 0) {
        silent.moveTo(cx + rim * Math.cos(at - half), cy + rim * Math.sin(at - half));
        silent.arc(cx, cy, rim, at - half, at + half);
        return;
      }
      if (nearest === null || range < nearest.range) nearest = { range, index };
      const path = (age[index] ?? Infinity) > OLD_S ? old : fresh;
      path.moveTo(cx, cy);
      path.arc(cx, cy, Math.max(2, reach(range)), at - half, at + half);
      path.closePath();
    });
    ctx.fillStyle = theme.echo;
    ctx.globalAlpha = 0.55;
    ctx.fill(fresh);
    ctx.globalAlpha = 0.18;
    ctx.fill(old);
    ctx.globalAlpha = 1;
    ctx.strokeStyle = theme.echo;
    ctx.lineWidth = 1;
    ctx.stroke(fresh);
    ctx.setLineDash([3, 3]);
    ctx.stroke(old);
    ctx.setLineDash([]);
    ctx.lineWidth = 3;
    ctx.stroke(silent);
    ctx.strokeStyle = theme.ink;
    ctx.lineWidth = 1.6;
    ctx.stroke(firesNow);
    ctx.strokeStyle = theme.stop;
    ctx.lineWidth = 2.2;
    ctx.stroke(crosses);
    this.#scale(ctx, cx, cy, reach, ring.range_max);
    this.#heading(ctx, cx, cy, -pose[2]);
    const text = [];
    if (nearest !== null) text.push(`nearest ${this.units.length(nearest.range)}, by sensor ${nearest.index}`);
    if (sensors.length > 0)
      text.push(
        `not trusted: ${sensors
          .slice(0, 3)
          .map(([index, fault]) => `${index} (${fault})`)
          .join(", ")}${sensors.length > 3 ? "…" : ""}`,
      );
    setText(byId("ring-text"), text.join("; ") || "nothing heard");
  }

  /**
   * @param {CanvasRenderingContext2D} ctx @param {number} cx @param {number} cy
   * @param {(range: number) => number} reach @param {number} range_max
   */
  #scale(ctx, cx, cy, reach, range_max) {
    const theme = this.theme;
    ctx.font = theme.font(9, 600);
    ctx.lineWidth = 3;
    ctx.strokeStyle = theme.panel;
    ctx.fillStyle = theme.muted;
    for (const step of [3, 10]) {
      const range = step * this.units.metres;
      if (range >= range_max) continue;
      const x = cx + reach(range) * 0.53,
        y = cy + reach(range) * 0.85;
      ctx.strokeText(`${step} ${this.units.name}`, x, y);
      ctx.fillText(`${step} ${this.units.name}`, x, y);
    }
  }

  /** @param {CanvasRenderingContext2D} ctx @param {number} cx @param {number} cy @param {number} angle */
  #heading(ctx, cx, cy, angle) {
    addHeading(ctx, cx, cy, angle, 19);
    ctx.fillStyle = this.theme.robot;
    ctx.fill();
    ctx.strokeStyle = this.theme.panel;
    ctx.lineWidth = 1;
    ctx.stroke();
  }
}
