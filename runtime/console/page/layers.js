// @ts-check
// The layers of the map, bottom to top; each is a draw function that can be switched on and off.

import { el, svg } from "./dom.js";
import { drawCanyons } from "./draw_canyons.js";
import { drawCrossPaths } from "./draw_cross_paths.js";
import { drawArcs, drawBeams } from "./draw_echoes.js";
import { drawEvidenceGrid } from "./draw_evidence.js";
import { drawGrid, drawScale, drawTruth } from "./draw_grid.js";
import {
  drawKnownWay,
  drawMapFrame,
  drawRobot,
  drawVectors,
  drawGoal,
  drawValley,
  trailDrawer,
} from "./draw_motion.js";
import { drawMission } from "./draw_mission.js";
import { drawPlaces } from "./draw_places.js";
import {
  drawAreas,
  drawClusters,
  drawEllipses,
  drawEvidence,
  drawLabels,
  drawModels,
  drawOutlines,
} from "./draw_objects.js";
import { AGE_LEGEND, segmentsDrawer } from "./draw_segments.js";
import { prefer, preferred } from "./preferences.js";

// [id, plane, name, draw, on, how it looks: SVG path, and its style sheet's colour]
/** @type {Array<[string, "back" | "front", string, (f: Drawing) => void, boolean, string, string, string?]>} */
const TABLE = [
  ["truth", "back", "true outlines (emulator)", drawTruth, true, "M20 2a8 8 0 1 1-.1 0Z", "truth", "3 2"],
  [
    "evidence_grid",
    "back",
    "evidence grid: occupied and free cells",
    drawEvidenceGrid,
    false,
    "M4 4h10v6h10v6h12M4 10h6v6",
    "occupied",
  ],
  ["grid", "back", "grid", drawGrid, true, "M3 7h34M3 14h34M10 2v16M20 2v16M30 2v16", "axis"],
  [
    "segments",
    "back",
    `outline segments (${AGE_LEGEND})`,
    segmentsDrawer(),
    true,
    "M4 6l12-3M18 10h16M6 16l14-2",
    "segment",
  ],
  ["clusters", "front", "clusters: rectangle and X", drawClusters, true, "M6 3h28v14H6zl28 14M34 3 6 17", "cluster"],
  ["arcs", "front", "arcs of recent echoes", drawArcs, true, "M8 16c6-8 18-8 24 0M12 18c5-6 11-6 16 0", "echo"],
  ["beams", "front", "beams firing now", drawBeams, true, "M20 19 6 4c8-4 20-4 28 0Z", "echo"],
  [
    "evidence",
    "front",
    "readings of the selected object",
    drawEvidence,
    true,
    "M5 14c6-8 14-8 18 0M29 6l7 7m0-7-7 7",
    "stop",
  ],
  [
    "models",
    "front",
    "models and walls (dashed: uncertain, or hidden by a wall)",
    drawModels,
    true,
    "M20 3a7 7 0 1 1-.1 0Z",
    "model",
  ],
  [
    "outlines",
    "front",
    "outlines of what is not straight (dashed: uncertain)",
    drawOutlines,
    true,
    "M4 14c6-9 10 4 16-4s8-8 16-3",
    "model",
  ],
  [
    "ellipses",
    "front",
    "95 % ellipses of their positions (dotted: magnified)",
    drawEllipses,
    true,
    "M8 12c2-6 22-10 24-4s-22 10-24 4Z",
    "ellipse",
  ],
  [
    "cross_paths",
    "front",
    "cross paths, and what reflected them (bar: wall, angle: corner, triangle: edge, ring: round, square: other model)",
    drawCrossPaths,
    true,
    "M6 15c5-10 23-10 28 0M16 17v-8m-3 4h6",
    "cross",
  ],
  [
    "areas",
    "front",
    "vacant areas: nothing stands here",
    drawAreas,
    true,
    "M20 2a8 8 0 1 1-.1 0ZM14 4l12 12M26 4 14 16",
    "muted",
    "2 3",
  ],
  [
    "places",
    "front",
    "places, no-go lines and areas, speed areas (dashed)",
    drawPlaces,
    true,
    "M6 4h14l4 12H4zm4 0-4 10m10-10-6 12m12-12-5 12",
    "stop",
  ],
  ["trail", "front", "trail", trailDrawer(), true, "M4 15c8-12 14 6 32-9", "robot"],
  [
    "known_way",
    "front",
    "way as corrected by its maps: path, uncertainty of each map, loop closures",
    drawKnownWay,
    true,
    "M4 15c8-12 14 6 32-9M20 6l12 9M10 6a4 3 0 1 1-.1 0Z",
    "ink",
  ],
  ["robot", "front", "robot", drawRobot, true, "M20 2a8 8 0 1 1-.1 0Zm8 8-12-4 3 4-3 4z", "robot"],
  [
    "map_frame",
    "front",
    "map frame, known room, and where the robot is: 95 % ellipse",
    drawMapFrame,
    true,
    "M8 17V4m0 13h13M24 10a6 4 0 1 1-.1 0Z",
    "drive",
  ],
  ["drive_request", "front", "goal", drawGoal, true, "M14 18V3l14 4-14 4", "drive"],
  [
    "valley",
    "front",
    "way to the goal; directions that are blocked",
    drawValley,
    true,
    "M8 6a14 14 0 0 1 24 0M6 18l8-6 12 2 8-8",
    "drive",
  ],
  [
    "canyons",
    "front",
    "dead ends: mouth, axis, depth, probability (dashed mouth: uncertain)",
    drawCanyons,
    true,
    "M32 4H10m22 12H10M32 4v12M10 2v16M4 10h16m-5-4 5 4-5 4",
    "stop",
  ],
  [
    "mission",
    "front",
    "waypoints and paths of the mission",
    drawMission,
    true,
    "M6 15 20 5l14 8M4 15a2 2 0 1 1 4 0 2 2 0 0 1-4 0",
    "drive",
    "4 2",
  ],
  ["vectors", "front", "schema vectors and their sum", drawVectors, true, "M4 16 30 5m0 0-8 0m8 0-5 6", "vector"],
  ["labels", "front", "labels and probability", drawLabels, true, "M14 17 20 3l6 14m-9.5-5h7", "model"],
  ["scale", "front", "scale", drawScale, true, "M5 7v6h30V7", "ink"],
];

/** @returns {Layer[]} */
export function makeLayers() {
  return TABLE.map(([id, plane, name, draw, on, shape, colour, dash]) => ({
    id,
    plane,
    name,
    draw,
    shape,
    colour,
    dash,
    on: preferred(`layer ${id}`, on),
  }));
}

/** @param {HTMLElement} list @param {Layer[]} layers @param {() => void} changed */
export function listLayers(list, layers, changed) {
  for (const layer of layers) {
    const box = el("input", {
      type: "checkbox",
      id: `layer-${layer.id}`,
      onchange: () => {
        layer.on = box.checked;
        prefer(`layer ${layer.id}`, layer.on);
        changed();
      },
    });
    box.checked = layer.on;
    const path = svg("path", {
      d: layer.shape,
      fill: "none",
      "stroke-width": 2,
      "stroke-dasharray": layer.dash ?? "none",
    });
    path.style.stroke = `var(--${layer.colour})`;
    const sample = svg("svg", { viewBox: "0 0 40 20", "aria-hidden": "true" }, path);
    list.append(el("li", {}, el("label", {}, box, sample, layer.name)));
  }
}
