// @ts-check
// Two stacked canvases, drawn only when something on them changed, at most once a frame of the screen. What seldom
// changes (grid, truth, segments) lies on the back one, so that a moving robot redraws the front one only.

import { fitted } from "./theme.js";

// The corners of an arrow head: direction off the front, and reach as a share of the radius.
const HEAD = /** @type {Pair[]} */ ([
  [0, 0.78],
  [2.5, 0.5],
  [Math.PI, 0.18],
  [-2.5, 0.5],
]);

export class Scene {
  #planes;
  #requested = false;

  /** @param {Canvases & SceneShared} parts */
  constructor({ back, front, layers, overlay, run, view, theme, units, selection, options }) {
    this.#planes = { back: { canvas: back, dirty: true }, front: { canvas: front, dirty: true } };
    this.layers = layers;
    this.overlay = overlay;
    this.shared = { run, view, theme, units, selection, options };
    new ResizeObserver(() => {
      view.resize(front.clientWidth, front.clientHeight);
      this.invalidate("back", "front");
    }).observe(front);
  }

  /** @param {("back" | "front")[]} names */
  invalidate(...names) {
    for (const name of names) this.#planes[name].dirty = true;
    if (this.#requested) return;
    this.#requested = true;
    requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    this.#requested = false;
    for (const [name, plane] of Object.entries(this.#planes)) {
      if (!plane.dirty) continue;
      plane.dirty = false;
      const { ctx, width, height } = fitted(plane.canvas);
      ctx.clearRect(0, 0, width, height);
      this.paint(name, frame(ctx, this.shared));
    }
  }

  /** @param {string} name @param {Drawing} f */
  paint(name, f) {
    for (const layer of this.layers) {
      if (layer.plane !== name || !layer.on) continue;
      f.ctx.save();
      layer.draw(f);
      f.ctx.restore();
    }
    if (name === "front") this.overlay(f);
  }

  // Everything on one canvas of its own, for a screenshot.
  /** @param {CanvasRenderingContext2D} ctx */
  picture(ctx) {
    const { width, height } = this.shared.view;
    ctx.fillStyle = this.shared.theme.map;
    ctx.fillRect(0, 0, width, height);
    for (const name of Object.keys(this.#planes)) this.paint(name, frame(ctx, this.shared));
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {SceneShared} shared @returns {Drawing} */
function frame(ctx, shared) {
  const { view } = shared;
  const base = ctx.getTransform();
  return {
    ...shared,
    ctx,
    px: 1 / view.scale, // a pixel, in metres
    labels: [], // boxes taken by text, so that labels keep clear of one another
    // From here on coordinates are metres, y up.
    inWorld() {
      ctx.setTransform(base);
      ctx.translate(view.width / 2, view.height / 2);
      ctx.scale(view.scale, -view.scale);
      ctx.translate(-view.x, -view.y);
    },
    // From here on coordinates are pixels, y down.
    onScreen() {
      ctx.setTransform(base);
    },
  };
}

// Whether two boxes [left, top, right, bottom] do.
/** @param {Quad} a @param {Quad} b */
export const overlap = (a, b) => !(a[2] < b[0] || a[0] > b[2] || a[3] < b[1] || a[1] > b[3]);

/** @param {Drawing} f @param {string} text @param {number} x @param {number} y @param {string} colour */
export function textWithHalo(f, text, x, y, colour) {
  const { ctx } = f;
  ctx.lineJoin = "round";
  ctx.lineWidth = 3.5;
  ctx.strokeStyle = f.theme.map;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

// Adds the line through some points to a path.
/** @param {CanvasPath} path @param {ReadonlyArray<readonly [number, number, ...unknown[]]>} points */
export function addLine(path, points) {
  points.forEach(([x, y], i) => (i === 0 ? path.moveTo(x, y) : path.lineTo(x, y)));
}

/** @param {Point} point @returns {Pair} */
export const pairOf = ({ x, y }) => [x, y];

/** @param {CanvasPath} path @param {number} x @param {number} y @param {number} arm */
export function addCross(path, x, y, arm) {
  path.moveTo(x - arm, y - arm);
  path.lineTo(x + arm, y + arm);
  path.moveTo(x - arm, y + arm);
  path.lineTo(x + arm, y - arm);
}

// Begins a path of an arrow head that shows where a robot of some radius looks.
/**
 * @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number} angle
 * @param {number} radius
 */
export function addHeading(ctx, x, y, angle, radius) {
  ctx.beginPath();
  for (const [turn, share] of HEAD) {
    const reach = share * radius;
    ctx.lineTo(x + reach * Math.cos(angle + turn), y + reach * Math.sin(angle + turn));
  }
  ctx.closePath();
}
