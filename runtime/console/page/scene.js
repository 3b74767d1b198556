// Two stacked canvases, drawn only when something on them changed, at most once a frame of the screen. What seldom
// changes (grid, truth, segments) lies on the back one, so that a moving robot redraws the front one only.

import { fitted } from "./theme.js";

export class Scene {
  #planes;
  #requested = false;

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
  picture(ctx) {
    const { width, height } = this.shared.view;
    ctx.fillStyle = this.shared.theme.map;
    ctx.fillRect(0, 0, width, height);
    for (const name of Object.keys(this.#planes)) this.paint(name, frame(ctx, this.shared));
  }
}

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
export const overlap = (a, b) => !(a[2] < b[0] || a[0] > b[2] || a[3] < b[1] || a[1] > b[3]);

export function textWithHalo(f, text, x, y, colour) {
  const { ctx } = f;
  ctx.lineJoin = "round";
  ctx.lineWidth = 3.5;
  ctx.strokeStyle = f.theme.map;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}
