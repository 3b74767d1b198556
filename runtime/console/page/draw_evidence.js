// The evidence grid: what the cells around the robot have answered. It is asked for once a second while its layer is
// on, and painted once for each answer, a pixel a cell.

const PERIOD_MS = 1000;
const UNKNOWN = -1;

export function drawEvidenceGrid(f) {
  const { grid } = f.run;
  if (grid === null || grid.columns === 0) return;
  if (grid.picture === undefined || grid.theme !== f.theme.occupied + f.theme.free) paint(grid, f.theme);
  f.inWorld();
  f.ctx.imageSmoothingEnabled = false;
  f.ctx.drawImage(grid.picture, grid.x, grid.y, grid.columns * grid.cell, grid.rows * grid.cell);
}

// The rows begin at the smallest y, and so does the map, whose y axis points up.
function paint(grid, theme) {
  const cells = Uint8Array.from(atob(grid.cells), (letter) => letter.charCodeAt(0));
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [grid.columns, grid.rows];
  const ctx = picture.getContext("2d");
  cells.forEach((byte, i) => {
    const percent = (byte << 24) >> 24;
    if (percent === UNKNOWN) return;
    ctx.fillStyle = percent >= 50 ? theme.occupied : theme.free;
    ctx.globalAlpha = Math.abs(percent - 50) / 50;
    ctx.fillRect(i % grid.columns, Math.floor(i / grid.columns), 1, 1);
  });
  grid.picture = picture;
  grid.theme = theme.occupied + theme.free;
}

// Asks for the grid while its layer is on; the answer comes as a message of its own.
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
      refused = error.answered; // a page that may only watch
      if (refused) notifications.showError(error);
    }
    waiting = false;
  }, PERIOD_MS);
}
