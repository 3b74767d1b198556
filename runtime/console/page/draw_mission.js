// @ts-check
// The places of a mission in the plan: numbered waypoints with final headings, paths, and what is left of the way.

import { inPlane } from "./map_frame.js";
import { addLine, textWithHalo } from "./scene.js";

const DOT_PX = 9;
const HEADING_PX = 20;

/** @param {Drawing} f */
export function drawMission(f) {
  const { ctx, run, theme, view } = f;
  const mission = run.state.drive_request;
  if (mission?.kind !== "mission") return;
  const places = mission.steps
    .flatMap(({ places, frame }, step) =>
      places.map(([x, y, degrees]) => {
        const at = inPlane(run.state.localized, frame, x, y, degrees === null ? null : (degrees * Math.PI) / 180);
        return at && { at: view.toScreen(at[0], at[1]), heading: at[2], step, isPath: places.length > 1 };
      }),
    )
    .filter((place) => place !== null);
  if (places.length === 0) return;
  f.onScreen();
  ctx.strokeStyle = theme.drive;
  ctx.lineWidth = 2;
  ctx.setLineDash([6, 5]);
  ctx.beginPath();
  const line = places.map(({ at }) => at);
  addLine(ctx, line);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.font = theme.font(11, 700);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  const hasEnded = mission.status === "done";
  for (const {
    at: [x, y],
    heading,
    step,
    isPath,
  } of places) {
    const isPast = hasEnded || step < mission.step,
      isCurrent = !hasEnded && step === mission.step;
    ctx.globalAlpha = isPast ? 0.45 : 1;
    ctx.strokeStyle = theme.drive;
    ctx.textAlign = "center"; // the name of the step under way is written with other settings
    if (heading !== null) {
      ctx.lineWidth = 3;
      ctx.beginPath();
      ctx.moveTo(x, y);
      ctx.lineTo(x + HEADING_PX * Math.cos(heading), y - HEADING_PX * Math.sin(heading));
      ctx.stroke();
    }
    ctx.beginPath();
    ctx.arc(x, y, isPath ? DOT_PX / 3 : DOT_PX, 0, 2 * Math.PI);
    ctx.fillStyle = isCurrent || isPath ? theme.drive : theme.paper;
    ctx.fill();
    ctx.lineWidth = 2;
    ctx.stroke();
    if (!isPath) {
      ctx.fillStyle = isCurrent ? theme.paper : theme.drive;
      ctx.fillText(String(step + 1), x, y);
    }
    if (isCurrent && !isPath) textWithHalo(f, mission.steps[step].name, x, y - DOT_PX - 9, theme.drive);
  }
  ctx.globalAlpha = 1;
}
