// @ts-check
// A robot described in a form: its ring is drawn as it is edited, and its file is saved once it is one that can drive.

import { messageOf } from "./connection.js";
import { button, byId, download, el, setText, svg } from "./dom.js";
import { Panel } from "./panel.js";
import { counted, numberIn } from "./units.js";

const NUMBERS = [
  "count",
  "radius_m",
  "beam_half_angle_deg",
  "resolution_m",
  "range_min_m",
  "range_max_m",
  "step_period_s",
  "body_radius_m",
  "speed_max_m_s",
  "turn_max_rad_s",
];
const SENSORS_MAX = 255; // config.robot.SENSORS_MAX
/** @param {string} field @returns {HTMLInputElement | HTMLSelectElement} */
const input = (field) => {
  const found = byId(`new-${field.replaceAll("_", "-")}`);
  if (found instanceof HTMLInputElement || found instanceof HTMLSelectElement) return found;
  throw new Error(`${field} is no field of the form`);
};
/** @param {string} field */
const number = (field) => numberIn(input(field).value) ?? 0;
/** @param {number} value */
const round = (value, digits = 4) => Number(value.toFixed(digits));
/** @param {number} angle */
const degrees = (angle) => round((angle * 180) / Math.PI, 2);

export class RobotForm extends Panel {
  /** @type {Triple[] | null} */
  #sensors = null; // [x, y, degrees] of each; null for a regular ring

  /** @param {Panels} parts */
  constructor(parts) {
    super(parts);
    const form = byId("robot-form"),
      drivers = byId("new-driver");
    parts.run.on("session", (session) => {
      const chosen = drivers.value;
      drivers.replaceChildren(...session.drivers.map((name) => el("option", {}, name)));
      if (session.drivers.includes(chosen)) drivers.value = chosen;
    });
    form.addEventListener("input", () => this.draw());
    form.addEventListener("submit", (event) => this.#save(event));
    byId("robot-each").addEventListener("change", () => this.#each());
    byId("robot-this").addEventListener("click", () => this.#ofRun());
    byId("robot-add").addEventListener("click", () => {
      const sensors = this.#sensors ?? [];
      this.#change([...sensors, [...(sensors.at(-1) ?? [0.1, 0, 0])]]);
    });
    this.draw();
  }

  // x, y (m) and direction (rad) of each sensor as the form has it now.
  /** @returns {Triple[]} */
  mounts() {
    if (this.#sensors !== null)
      return this.#sensors.map(([x, y, turn]) => [x || 0, y || 0, ((turn || 0) * Math.PI) / 180]);
    const count = Math.min(SENSORS_MAX, Math.max(0, Math.floor(number("count")) || 0)),
      radius = number("radius_m") || 0;
    return Array.from({ length: count }, (_, i) => {
      const angle = (2 * Math.PI * i) / count;
      return [radius * Math.cos(angle), radius * Math.sin(angle), angle];
    });
  }

  // The mounting from above, the front to the right as on the map: body, sensors with their beams and numbers.
  draw() {
    const mounts = this.mounts(),
      body = Math.max(0.01, number("body_radius_m") || 0.01);
    const reach = Math.max(body, ...mounts.map(([x, y]) => Math.hypot(x, y))),
      beam = 0.45 * reach,
      size = 1.25 * (reach + beam);
    const half = (Math.min(89, Math.max(0.1, number("beam_half_angle_deg") || 0.1)) * Math.PI) / 180;
    /** @param {number} x @param {number} y @param {number} angle @param {number} far */
    const at = (x, y, angle, far) => `${round(x + far * Math.cos(angle))},${round(-(y + far * Math.sin(angle)))}`;
    const text = Math.min(0.09, 2.2 / Math.max(1, mounts.length)) * size;
    /** @param {Triple} mount @param {number} i */
    const sensor = ([x, y, angle], i) => {
      const name = svg("text", {
        x: x + 1.18 * beam * Math.cos(angle),
        y: -(y + 1.18 * beam * Math.sin(angle)),
        "font-size": text,
        "text-anchor": "middle",
        "dominant-baseline": "central",
        class: "mark",
      });
      name.textContent = String(i);
      const arc = `A${beam},${beam} 0 0 0 ${at(x, y, angle + half, beam)}`;
      return [
        svg("path", {
          d: `M${at(x, y, 0, 0)} L${at(x, y, angle - half, beam)} ${arc}Z`,
          class: "beam",
          "stroke-width": 0.005 * size,
        }),
        svg("circle", { cx: x, cy: -y, r: 0.014 * size, class: "mark" }),
        name,
      ];
    };
    const view = byId("robot-picture");
    view.setAttribute("viewBox", `${-size} ${-size} ${2 * size} ${2 * size}`);
    view.setAttribute("aria-label", `The ring from above, its front to the right: ${counted(mounts.length, "sensor")}`);
    view.replaceChildren(
      svg("circle", { cx: 0, cy: 0, r: body, class: "body", "stroke-width": 0.012 * size }),
      svg("polygon", {
        points: `${0.55 * body},0 ${-0.3 * body},${0.3 * body} ${-0.12 * body},0 ${-0.3 * body},${-0.3 * body}`,
        class: "front",
      }),
      ...mounts.flatMap(sensor),
    );
  }

  /** @param {Triple[] | null} sensors */
  #change(sensors) {
    this.#sensors = sensors;
    const isOwn = sensors !== null;
    byId("robot-each").checked = isOwn;
    byId("robot-sensors-part").hidden = !isOwn;
    for (const field of ["count", "radius_m"]) input(field).disabled = isOwn;
    if (isOwn) {
      byId("robot-add").disabled = sensors.length >= SENSORS_MAX;
      byId("robot-sensors").replaceChildren(...sensors.map((sensor, i) => this.#row(sensor, i)));
    }
    this.draw();
  }

  /** @param {Triple} sensor @param {number} i */
  #row(sensor, i) {
    /** @param {0 | 1 | 2} k @param {string} name */
    const value = (k, name) =>
      el("input", {
        class: "number",
        inputmode: "decimal",
        autocomplete: "off",
        value: Number.isNaN(sensor[k]) ? "" : String(sensor[k]),
        "aria-label": `${name} of sensor ${i}`,
        oninput: (/** @type {InputEvent} */ { target }) => {
          if (target instanceof HTMLInputElement) sensor[k] = numberIn(target.value) ?? Number.NaN;
        },
      });
    return el(
      "li",
      {},
      el("span", {}, String(i)),
      value(0, "x (m)"),
      value(1, "y (m)"),
      value(2, "direction (degrees)"),
      button("✕", () => this.#change((this.#sensors ?? []).filter((_, k) => k !== i)), {
        class: "small",
        "aria-label": `Remove sensor ${i}`,
      }),
    );
  }

  // From the regular ring to its sensors one by one, and back.
  #each() {
    this.#change(
      byId("robot-each").checked ? this.mounts().map(([x, y, angle]) => [round(x), round(y), degrees(angle)]) : null,
    );
  }

  // Begins with the robot of this run.
  #ofRun() {
    if (this.run.session === null) return;
    const { name, ring, body } = this.run.session;
    const given = {
      name: name ?? "",
      beam_half_angle_deg: degrees(ring.half_angle),
      range_min_m: ring.range_min,
      range_max_m: ring.range_max,
      body_radius_m: body.radius,
      speed_max_m_s: body.speed_max,
      turn_max_rad_s: body.turn_max,
    };
    for (const [field, value] of Object.entries(given)) input(field).value = String(value);
    this.#change(ring.mounts.map(([x, y, angle]) => [round(x), round(y), degrees(angle)]));
  }

  /** @param {SubmitEvent} event */
  async #save(event) {
    event.preventDefault();
    const isOwn = this.#sensors !== null,
      name = byId("new-name").value.trim();
    const wrong = NUMBERS.find(
      (field) =>
        !(isOwn && ["count", "radius_m"].includes(field)) &&
        !Number.isFinite(numberIn(input(field).value) ?? Number.NaN),
    );
    if (wrong) {
      setText(byId("robot-error"), `${input(wrong).labels?.[0].firstChild?.textContent?.trim()}: a number is wanted`);
      input(wrong).focus();
      return;
    }
    const odd = this.#sensors?.findIndex((sensor) => !sensor.every(Number.isFinite)) ?? -1;
    if (odd >= 0) {
      setText(byId("robot-error"), `sensor ${odd}: three numbers are wanted`);
      return;
    }
    try {
      const toml = await this.connection.request({
        type: "robot_file",
        name,
        driver: byId("new-driver").value,
        preset: byId("new-preset").value,
        count: isOwn ? null : Math.floor(number("count")),
        radius_m: isOwn ? null : number("radius_m"),
        sensors: this.#sensors,
        beam_half_angle_deg: number("beam_half_angle_deg"),
        resolution_m: number("resolution_m"),
        range_min_m: number("range_min_m"),
        range_max_m: number("range_max_m"),
        step_period_s: number("step_period_s"),
        body_radius_m: number("body_radius_m"),
        speed_max_m_s: number("speed_max_m_s"),
        turn_max_rad_s: number("turn_max_rad_s"),
        synchro: byId("robot-synchro").checked,
      });
      setText(byId("robot-error"), "");
      const file = `${(name || "my-robot").toLowerCase().replace(/[^a-z0-9_-]+/g, "-")}.toml`;
      download(file, new Blob([toml], { type: "application/toml" }));
      this.notifications.toast(`${file}: good. Drive it in the emulator: echolocate run --robot ${file}`);
    } catch (error) {
      setText(byId("robot-error"), messageOf(error));
    }
  }
}
