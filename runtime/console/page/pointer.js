// @ts-check
// Pointers on the map: one does what the tool does, two pinch and pan whatever the tool, the wheel zooms, the middle
// and the right button pan.

const WHEEL = 0.0016;

/** @param {HTMLCanvasElement} canvas @param {View} view @param {() => Tool} tool */
export function watchPointers(canvas, view, tool) {
  /** @type {Map<number, Spot>} */
  const down = new Map();
  let pinching = false;
  /** @type {number | null} */
  let panning = null;

  /** @param {PointerEvent | WheelEvent} event @returns {Spot} */
  const spot = (event) => {
    const box = canvas.getBoundingClientRect();
    const sx = event.clientX - box.left,
      sy = event.clientY - box.top;
    const [x, y] = view.toWorld(sx, sy);
    return {
      sx,
      sy,
      x,
      y,
      shift: event.shiftKey,
      touch: event instanceof PointerEvent && event.pointerType === "touch",
    };
  };
  const pair = () => {
    const [a, b] = [...down.values()];
    return { sx: (a.sx + b.sx) / 2, sy: (a.sy + b.sy) / 2, apart: Math.max(10, Math.hypot(a.sx - b.sx, a.sy - b.sy)) };
  };

  canvas.addEventListener("pointerdown", (event) => {
    const at = spot(event);
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, at);
    if (down.size === 2) {
      tool().cancel?.();
      panning = null;
      pinching = true;
    } else if (down.size === 1) {
      if (event.button === 1 || event.button === 2) panning = event.pointerId;
      else tool().down?.(at);
    }
    canvas.focus({ preventScroll: true });
    event.preventDefault();
  });

  canvas.addEventListener("pointermove", (event) => {
    const at = spot(event);
    const was = down.get(event.pointerId);
    if (was === undefined) {
      tool().hover?.(at);
      return;
    }
    if (pinching && down.size === 2) {
      const before = pair();
      down.set(event.pointerId, at);
      const after = pair();
      view.pan(after.sx - before.sx, after.sy - before.sy);
      view.zoom(after.apart / before.apart, after.sx, after.sy);
      return;
    }
    down.set(event.pointerId, at);
    if (panning === event.pointerId) view.pan(at.sx - was.sx, at.sy - was.sy);
    else if (!pinching) tool().move?.(at, was);
  });

  /** @param {PointerEvent} event @param {boolean} cancelled */
  const up = (event, cancelled) => {
    if (!down.delete(event.pointerId)) return;
    if (panning === event.pointerId) panning = null;
    else if (!pinching) {
      if (cancelled) tool().cancel?.();
      else tool().up?.(spot(event));
    }
    if (down.size === 0) pinching = false;
  };
  canvas.addEventListener("pointerup", (event) => up(event, false));
  canvas.addEventListener("pointercancel", (event) => up(event, true));
  canvas.addEventListener("pointerleave", () => tool().leave?.());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const at = spot(event);
      const pixels = event.deltaMode === 1 ? 30 * event.deltaY : event.deltaY;
      view.zoom(Math.exp(-Math.max(-400, Math.min(400, pixels)) * WHEEL), at.sx, at.sy);
    },
    { passive: false },
  );
}
