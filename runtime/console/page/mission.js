// @ts-check
// The mission panel: its state machine with the step under way and why it waits; start, hold, resume, skip.

import { byId, el, setAttribute, setText } from "./dom.js";
import { Panel } from "./panel.js";

const ENDS = new Set(["done", "failed"]);

export class MissionPanel extends Panel {
  #shown = ""; // what the list of steps shows

  /** @param {Panels} parts */
  constructor(parts) {
    super(parts);
    const { run } = parts;
    byId("mission-start").addEventListener("click", () =>
      this.ask({ type: "start_mission", name: byId("mission-name").value }),
    );
    byId("mission-hold").addEventListener("click", () => this.ask({ type: "hold_mission" }));
    byId("mission-resume").addEventListener("click", () => this.ask({ type: "resume_mission" }));
    byId("mission-skip").addEventListener("click", () => this.ask({ type: "skip_step" }));
    run.on("session", ({ missions = [] }) => {
      byId("mission-name").replaceChildren(
        ...missions.map(({ name, about }) => el("option", { value: name, title: about }, name)),
      );
    });
    run.on("state", () => this.#refresh());
  }

  #refresh() {
    const { drive_request: mission, hold_reason: reason } = this.run.state;
    byId("mission").hidden = mission?.kind !== "mission";
    if (mission?.kind !== "mission") {
      this.#shown = "";
      return;
    }
    const { name, status, steps } = mission;
    setText(byId("mission-title"), `${name}: ${status}`);
    setText(byId("mission-about"), mission.about);
    setText(
      byId("mission-reason"),
      mission.reason ??
        reason ??
        `${mission.step_s.toFixed(0)} s and ${this.units.number(mission.way_m)} ${this.units.name} in this step`,
    );
    setAttribute(byId("mission-reason"), "data-status", status);
    const text = JSON.stringify(steps);
    if (text !== this.#shown) {
      this.#shown = text;
      byId("mission-steps").replaceChildren(...steps.map(stepRow));
    }
    [...byId("mission-steps").children].forEach((row, i) => {
      const isCurrent = i === mission.step;
      setAttribute(row, "data-status", isCurrent ? status : "");
      if (isCurrent) setAttribute(row, "aria-current", "step");
      else row.removeAttribute("aria-current");
    });
    if (!this.enabled) return;
    byId("mission-hold").disabled = status !== "running";
    byId("mission-resume").disabled = status !== "held";
    byId("mission-skip").disabled = ENDS.has(status);
  }
}

/** @param {StepRow} step */
function stepRow({ name, schemas, place, until }) {
  /** @param {string} go */
  const lead = (go) => (go === "next" ? "next step" : go);
  return el(
    "li",
    {},
    el("strong", {}, name),
    ` ${schemas.join(" + ").replaceAll("_", "-") || "stand"}`,
    place === null ? null : el("em", {}, ` ${place}`),
    el("ul", {}, ...until.map(([when, go]) => el("li", {}, `${when} → ${lead(go)}`))),
  );
}
