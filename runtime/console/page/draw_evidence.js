// @ts-check
// The evidence grid: what the cells around the robot have answered. It is asked for once a second while its layer is
// on, and painted once for each answer, a pixel a cell.

import { RequestError } from "./connection.js";
import { context } from "./theme.js";

const PERIOD_MS = 1000;
const UNKNOWN = -1;

/** @param {Drawing} f */
export function drawEvidenceGrid(f) {
  const { grid } = f.run;
  if (grid === null || grid.columns === 0) return;
  const { x = 0, y = 0, cell = 0, columns, rows } = grid;
  const picture = grid.theme === f.theme.occupied + f.theme.free ? grid.picture : null;
  f.inWorld();
  f.ctx.imageSmoothingEnabled = false;
  f.ctx.drawImage(picture ?? paint(grid, f.theme), x, y, columns * cell, rows * cell);
}

// The rows begin at the smallest y, and so does the map, whose y axis points up.
/** @param {Grid} grid @param {Theme} theme */
function paint(grid, theme) {
  const cells = Uint8Array.from(atob(grid.cells), (letter) => letter.charCodeAt(0));
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [grid.columns, grid.rows];
  const ctx = context(picture);
  cells.forEach((byte, i) => {
    const percent = (byte << 24) >> 24;
    if (percent === UNKNOWN) return;
    ctx.fillStyle = percent >= 50 ? theme.occupied : theme.free;
    ctx.globalAlpha = Math.abs(percent - 50) / 50;
    ctx.fillRect(i % grid.columns, Math.floor(i / grid.columns), 1, 1);
  });
  grid.picture = picture;
  grid.theme = theme.occupied + theme.free;
  return picture;
}

// Asks for the grid while its layer is on; the answer comes as a message of its own.
/** @param {Pick<Parts, "run" | "connection" | "notifications"> & { layer: Layer; changed: () => void }} parts */
export function watchGrid({ layer, run, connection, notifications, changed }) {
  let waiting = false,
    warned = false,
    refused = false;
  connection.on("open", () => {
    refused = false;
  });
  connection.on("grid", (message) => {
    run.grid = message;
    if (layer.on && !message.on && !warned)
      notifications.toast("This run keeps no evidence grid: set perception.grid.method to directed.");
    warned = !message.on;
    changed();
  });
  setInterval(async () => {
    if (!layer.on || waiting || refused || document.hidden || !connection.open || !run.fresh) return;
    waiting = true;
    try {
      await connection.request({ type: "show_grid" });
    } catch (error) {
      refused = error instanceof RequestError && error.answered; // a page that may only watch
      if (refused) notifications.showError(error);
    }
    waiting = false;
  }, PERIOD_MS);
}
