// @ts-check
// Converts metres in the odometry frame (y up) to screen pixels (y down) and back; pan, zoom, follow, fit.

import { Emitter } from "./emitter.js";

const SCALE_MIN = 3;
const SCALE_MAX = 6000;

/** @extends {Emitter<{ changed: []; follow: [boolean] }>} */
export class View extends Emitter {
  width = 1;
  height = 1;
  x = 0; // the middle of the screen, m
  y = 0;
  scale = 60; // pixels a metre
  follow = false;
  insets = { left: 20, right: 20, top: 20, bottom: 30 }; // px covered by controls over the map
  touched = false; // by the operator: from then on the view is not fitted automatically

  /** @param {number} width @param {number} height */
  resize(width, height) {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.emit("changed");
  }

  /** @param {number} x @param {number} y @returns {Pair} */
  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  /** @param {number} sx @param {number} sy @returns {Pair} */
  toWorld(sx, sy) {
    return [this.x + (sx - this.width / 2) / this.scale, this.y - (sy - this.height / 2) / this.scale];
  }

  // Moves the view by this many pixels.
  /** @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.touched = true;
    this.setFollow(false);
    this.emit("changed");
  }

  // Zooms about (sx, sy), or about the robot while following it.
  /** @param {number} factor */
  zoom(factor, sx = this.width / 2, sy = this.height / 2) {
    const scale = Math.min(SCALE_MAX, Math.max(SCALE_MIN, this.scale * factor));
    if (!this.follow) {
      const [x, y] = this.toWorld(sx, sy);
      this.x = x - (sx - this.width / 2) / scale;
      this.y = y + (sy - this.height / 2) / scale;
    }
    this.scale = scale;
    this.touched = true;
    this.emit("changed");
  }

  /** @param {Spacing} box */
  fit({ left, right, bottom, top }) {
    const { insets } = this;
    const wide = Math.max(40, this.width - insets.left - insets.right) / Math.max(right - left, 0.5);
    const high = Math.max(40, this.height - insets.top - insets.bottom) / Math.max(top - bottom, 0.5);
    this.scale = Math.min(SCALE_MAX, Math.max(SCALE_MIN, Math.min(wide, high)));
    this.x = (left + right) / 2 + (insets.right - insets.left) / 2 / this.scale;
    this.y = (bottom + top) / 2 + (insets.top - insets.bottom) / 2 / this.scale;
    this.setFollow(false);
    this.emit("changed");
  }

  // Whether a box lies within the view.
  /** @param {Spacing} box */
  shows({ left, right, bottom, top }) {
    const [x1, y1] = this.toScreen(left, top),
      [x2, y2] = this.toScreen(right, bottom);
    return x1 >= 0 && y1 >= 0 && x2 <= this.width && y2 <= this.height;
  }

  /** @param {boolean} on */
  setFollow(on) {
    if (this.follow === on) return;
    this.follow = on;
    this.touched = true;
    this.emit("follow", on);
  }

  /** @param {number} x @param {number} y */
  followTo(x, y) {
    if (!this.follow || (this.x === x && this.y === y)) return;
    this.x = x;
    this.y = y;
    this.emit("changed");
  }
}

// The bounding box of everything on the map.
/** @param {RunState} run */
export function extent(run) {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  /** @param {number} x @param {number} y */
  const add = (x, y, r = 0) => {
    box.left = Math.min(box.left, x - r);
    box.right = Math.max(box.right, x + r);
    box.bottom = Math.min(box.bottom, y - r);
    box.top = Math.max(box.top, y + r);
  };
  const [x, y] = run.state.pose;
  add(x, y, 0.5);
  for (const s of run.segments.values()) {
    add(s.x1, s.y1);
    add(s.x2, s.y2);
  }
  for (const { x, y, ends } of run.state.objects) {
    if (ends) {
      add(ends[0], ends[1]);
      add(ends[2], ends[3]);
    } else add(x, y, 0.4);
  }
  const truth = run.session?.truth;
  for (const [dx, dy, r] of truth?.drums ?? []) add(dx, dy, r);
  for (const [x1, y1, x2, y2] of truth?.walls ?? []) {
    add(x1, y1);
    add(x2, y2);
  }
  for (const polygon of truth?.polygons ?? []) for (const [px, py] of polygon) add(px, py);
  for (const point of run.trail) add(point.x, point.y);
  return box;
}
