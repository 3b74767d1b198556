// The mission panel: its state machine with the step under way and why it waits; start, hold, resume, skip.

import { byId, el, setAttribute, setText } from "./dom.js";

const ENDS = new Set(["done", "failed"]);

export class MissionPanel {
  #shown = null; // what the list of steps shows

  constructor({ run, units, connection, notifications }) {
    Object.assign(this, { run, units, connection, notifications });
    byId("mission-start").addEventListener("click", () =>
      this.#ask({ type: "start_mission", name: byId("mission-name").value }),
    );
    for (const [id, type] of [
      ["mission-hold", "hold_mission"],
      ["mission-resume", "resume_mission"],
      ["mission-skip", "skip_step"],
    ]) {
      byId(id).addEventListener("click", () => this.#ask({ type }));
    }
    run.on("session", ({ missions = [] }) => {
      byId("mission-name").replaceChildren(
        ...missions.map(({ name, about }) => el("option", { value: name, title: about }, name)),
      );
    });
    run.on("state", () => this.#refresh());
  }

  #ask(message) {
    return this.connection.request(message).catch(this.notifications.showError);
  }

  #refresh() {
    const { drive_request: mission, hold_reason: reason } = this.run.state;
    const isOne = mission?.kind === "mission";
    byId("mission").hidden = !isOne;
    if (!isOne) {
      this.#shown = null;
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
    if (!this.run.state.controller || this.run.watchesRecording) return;
    byId("mission-hold").disabled = status !== "running";
    byId("mission-resume").disabled = status !== "held";
    byId("mission-skip").disabled = ENDS.has(status);
  }
}

function stepRow({ name, schemas, until }) {
  const lead = (go) => (go === "next" ? "next step" : go);
  return el(
    "li",
    {},
    el("strong", {}, name),
    ` ${schemas.join(" + ").replaceAll("_", "-") || "stand"}`,
    el("ul", {}, ...until.map(([when, go]) => el("li", {}, `${when} → ${lead(go)}`))),
  );
}
