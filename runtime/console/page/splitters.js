// @ts-check
// Borders between map, panels and cycle that can be moved, by pointer or arrow keys; Enter or a double click moves them
// back. Their places are kept.

import { byId, byKey, PRESS_ENDS, setAttribute } from "./dom.js";
import { prefer, preferred } from "./preferences.js";

const STEP_PX = 24;

// [id, style property, which side grows, least size, least rest, px]
const BORDERS = [
  { id: "split-panel", property: "--panel-width", across: true, of: "tabs", grows: -1, least: 260, rest: 340 },
  { id: "split-beside", property: "--beside-width", across: true, of: "beside", grows: -1, least: 260, rest: 800 },
  { id: "split-cycle", property: "--cycle-height", across: false, of: "panel-cycle", grows: -1, least: 110, rest: 240 },
  { id: "split-map", property: "--map-height", across: false, of: "map", grows: 1, least: 140, rest: 180 },
];

export function watchSplitters() {
  const main = document.querySelector("main");
  if (main === null) return;
  for (const border of BORDERS) watch(main, border);
}

/** @param {HTMLElement} main @param {(typeof BORDERS)[number]} border */
function watch(main, { id, property, across, of, grows, least, rest }) {
  const handle = byId(id),
    side = byId(of);
  /** @param {HTMLElement} element */
  const size = (element) => (across ? element.getBoundingClientRect().width : element.getBoundingClientRect().height);
  const most = () => Math.max(least, size(main) - rest);
  /** @param {number} px */
  const put = (px) => {
    const kept = px === 0 ? 0 : Math.round(Math.max(least, Math.min(px, most())));
    if (kept === 0) main.style.removeProperty(property);
    else main.style.setProperty(property, `${kept}px`);
    prefer(property, kept);
    describe();
  };
  const describe = () => {
    setAttribute(handle, "aria-valuemin", least);
    setAttribute(handle, "aria-valuemax", Math.round(most()));
    setAttribute(handle, "aria-valuenow", Math.round(size(side)));
  };
  const kept = preferred(property, 0);
  if (kept > 0) main.style.setProperty(property, `${kept}px`);

  let from = /** @type {{ at: number; size: number } | null} */ (null); // {at, size} where a drag began
  /** @param {PointerEvent} event */
  const at = (event) => (across ? event.clientX : event.clientY);
  handle.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    handle.focus();
    handle.setPointerCapture(event.pointerId);
    from = { at: at(event), size: size(side) };
  });
  handle.addEventListener("pointermove", (event) => from && put(from.size + grows * (at(event) - from.at)));
  for (const name of PRESS_ENDS)
    handle.addEventListener(name, () => {
      from = null;
    });
  handle.addEventListener("dblclick", () => put(0));
  handle.addEventListener("keydown", (event) => {
    const by = byKey(event, { [across ? "ArrowRight" : "ArrowDown"]: 1, [across ? "ArrowLeft" : "ArrowUp"]: -1 });
    const to = byKey(event, { Home: least, End: most(), Enter: 0 });
    if (by === undefined && to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    put(to ?? size(side) + grows * (by ?? 0) * STEP_PX);
  });
  new ResizeObserver(describe).observe(side);
}
