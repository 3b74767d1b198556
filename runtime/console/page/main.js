// The operator console: makes the parts and joins them. What each does is in its own module.

import { byId, el, mark, say } from "./dom.js";
import { Charts } from "./charts.js";
import { Connection } from "./connection.js";
import { Drive } from "./drive.js";
import { watchKeyboard } from "./keyboard.js";
import { listLayers, makeLayers } from "./layers.js";
import { Log } from "./log.js";
import { Notices } from "./notices.js";
import { mapWords, Objects } from "./objects.js";
import { Parameters } from "./parameters.js";
import { watchPointers } from "./pointer.js";
import { prefer, preferred } from "./preferences.js";
import { Ring } from "./ring.js";
import { Scene } from "./scene.js";
import { Selection } from "./selection.js";
import { Status } from "./status.js";
import { Tabs } from "./tabs.js";
import { Teleoperation } from "./teleoperation.js";
import { Theme } from "./theme.js";
import { screenshot, Time } from "./time.js";
import { moveTool, placeTool } from "./tool_objects.js";
import { goalTool, tapeTool } from "./tool_points.js";
import { chosenRow, panTool, selectTool } from "./tool_select.js";
import { Toolbox } from "./tools.js";
import { Units } from "./units.js";
import { extent, View } from "./view.js";
import { World } from "./world.js";

const WORDS_EVERY_MS = 5000;
const ROOM_M = 0.6;

// The token does not stay in the address bar, where a projector would show it; a reload finds it again.
function takeToken() {
  const given = new URLSearchParams(location.search).get("token");
  if (given !== null) {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname);
  }
  return given ?? sessionStorage.getItem("token") ?? "";
}

const token = takeToken();
const query = token === "" ? "" : `?token=${encodeURIComponent(token)}`;
const connection = new Connection(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws${query}`);
const world = new World(), view = new View(), units = new Units(), notices = new Notices();
connection.showsRecording = () => world.watchesRecording;
const selection = new Selection(world);
const options = { ellipseScale: preferred("ellipse scale", 10) };
const front = byId("map-front");
const layers = makeLayers();

let scene = null;
const redraw = () => scene?.invalidate("front");
const redrawAll = () => scene?.invalidate("back", "front");
const theme = new Theme(() => {
  redrawAll();
  drawInstruments();
});

const drive = {}; // filled below: the goal tool and the drive panel know of each other
const said = (words) => say(byId("said"), words);
const tools = new Toolbox({
  box: byId("tools"), canvas: front, view, redraw,
  tools: [
    panTool(view),
    selectTool({ world, view, selection, redraw }),
    moveTool({ world, view, selection, connection, notices, redraw }),
    placeTool({ world, view, connection, notices, redraw }),
    goalTool({ sendGoal: (x, y) => drive.panel.goal(x, y).then(() => notices.toast(`Goal: ${units.place(x, y)}`), notices.refused), after: () => tools.choose("pan") }),
    tapeTool({ units, said, redraw }),
  ],
});
scene = new Scene({ back: byId("map-back"), front, layers, overlay: (f) => tools.draw(f), world, view, theme, units, selection, options });
watchPointers(front, view, () => tools.current);

const hand = new Teleoperation({ connection, world });
drive.panel = new Drive({ world, units, connection, notices, hand, tools });
const status = new Status({ world, units, connection, notices });
const objects = new Objects({ world, units, selection, connection, notices, tools });
const parameters = new Parameters({ world, connection, notices });
const log = new Log(world);
const time = new Time({ world, connection, notices, shoot: () => screenshot({ scene, view, world, theme, units }) });
const ring = new Ring({ canvas: byId("ring"), words: byId("ring-words"), world, theme, units });
const charts = new Charts({ phases: byId("phases"), late: byId("late"), legend: byId("phases-legend"), lateLegend: byId("late-legend"), world, theme });
const chosen = chosenRow({ world, selection, connection, notices });
const tabs = new Tabs((name) => {
  drawInstruments();
  if (name === "time") time.shown();
});

let instrumentsAsked = false;
function drawInstruments() {
  if (instrumentsAsked) return;
  instrumentsAsked = true;
  requestAnimationFrame(() => {
    instrumentsAsked = false;
    ring.draw();
    charts.draw();
  });
}
new ResizeObserver(() => drawInstruments()).observe(byId("panel-cycle"));

// What lies over the map, so that what is fitted is not hidden under it: a row takes height, a column width.
function measureInsets() {
  const map = byId("map").getBoundingClientRect();
  const insets = { left: 20, right: 20, top: 20, bottom: 34 };
  for (const box of [byId("tools"), byId("view-buttons")].map((one) => one.getBoundingClientRect())) {
    if (box.width > box.height) {
      if (box.top - map.top < map.bottom - box.bottom) insets.top = Math.max(insets.top, box.bottom - map.top + 10);
      else insets.bottom = Math.max(insets.bottom, map.bottom - box.top + 10);
    } else if (box.left - map.left < map.right - box.right) insets.left = Math.max(insets.left, box.right - map.left + 16);
    else insets.right = Math.max(insets.right, map.right - box.left + 16);
  }
  view.insets = insets;
}
new ResizeObserver(() => {
  measureInsets();
  if (!view.touched && world.fresh) fitUntouched();
}).observe(byId("map"));

// The view.
const fit = () => view.fit(extent(world));
for (const [id, act] of Object.entries({
  "zoom-in": () => view.zoom(1.25), "zoom-out": () => view.zoom(0.8), fit, follow: () => view.setFollow(!view.follow),
  units: () => units.choose(units.name === "m" ? "ft" : "m"),
})) byId(id).addEventListener("click", act);
view.on("changed", redrawAll);
view.on("follow", (on) => {
  mark(byId("follow"), "aria-pressed", on);
  if (on) view.followTo(world.state.pose[0], world.state.pose[1]);
});
let unitsGiven = preferred("units", "");
units.on("changed", () => {
  say(byId("units"), units.name);
  mark(byId("units"), "aria-label", `Units: ${units.word}`);
  redrawAll();
  drawInstruments();
});
byId("units").addEventListener("click", () => prefer("units", units.name));
byId("ellipse-scale").value = String(options.ellipseScale);
byId("ellipse-scale").addEventListener("change", (event) => {
  options.ellipseScale = Number(event.target.value);
  prefer("ellipse scale", options.ellipseScale);
  redraw();
});
listLayers(byId("layers"), layers, redrawAll);
selection.on("segments", redrawAll);
selection.on("object", redraw);
world.on("evidence", redraw);

// What comes from the robot.
world.on("session", (session) => {
  units.choose(unitsGiven || session.units);
  redrawAll();
});
let fitted = false;
let drawnVersion = -1, drawnSecond = -1, words_ms = -Infinity;
world.on("state", (state) => {
  const now = performance.now();
  if (!view.touched && !(fitted && view.shows(extent(world)))) fitUntouched(fitted ? ROOM_M : 0);
  view.followTo(state.pose[0], state.pose[1]);
  const second = Math.floor(state.robot_s);
  if (world.segmentsVersion !== drawnVersion || second !== drawnSecond) {
    [drawnVersion, drawnSecond] = [world.segmentsVersion, second];
    scene.invalidate("back");
  }
  redraw();
  drawInstruments();
  if (now - words_ms > WORDS_EVERY_MS) {
    words_ms = now;
    say(byId("map-words"), mapWords(world, units));
  }
});
// Until somebody moves the map, everything stays in view; what grew out of it once has room to grow on.
function fitUntouched(room = 0) {
  const { left, right, bottom, top } = extent(world);
  view.fit({ left: left - room, right: right + room, bottom: bottom - room, top: top + room });
  view.touched = false;
  fitted = true;
}

connection.on("session", (session) => world.beginSession(session));
connection.on("state", (state) => world.apply(state, performance.now()));
connection.on("log", (entry) => world.note(entry));
connection.on("role", (message) => world.emit("role", message));
connection.on("evidence", (message) => objects.hear(message));
connection.on("parameters", (message) => parameters.show(message.parameters));
connection.on("refused", (refusal) => notices.toast(refusal.message));

byId("report").href = `/report${query}`;
byId("clear-map").addEventListener("click", () => notices.ask("Clear the map?", el("p", {}, "All segments, clusters and objects are forgotten; recognition begins anew."), [
  ["Keep it", null],
  ["Clear the map", () => void connection.ask({ type: "clear_map" }).catch(notices.refused)],
]));
watchKeyboard({ drive: drive.panel, tools, view, fit, units, chosen, time, parameters, notices, drivingByKeys: () => byId("hand-keys").checked });
connection.connect();

export { connection, hand, log, scene, selection, status, tabs, tools, units, view, world };
