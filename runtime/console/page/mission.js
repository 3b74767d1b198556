// The mission panel: its state machine with the step under way and why it waits; start, hold, resume, skip; the route.

import { byId, el, setAttribute, setText } from "./dom.js";
import { inMap } from "./map_frame.js";

const ENDS = new Set(["done", "failed"]);

export class MissionPanel {
  #shown = null; // what the list of steps shows
  #sent = null; // the route that was sent and has not come back yet

  constructor({ run, units, connection, notifications, tools }) {
    Object.assign(this, { run, units, connection, notifications });
    byId("mission-start").addEventListener("click", () => this.#ask({ type: "start_mission", name: byId("mission-name").value }));
    for (const [id, type] of [["mission-hold", "hold_mission"], ["mission-resume", "resume_mission"], ["mission-skip", "skip_step"]]) {
      byId(id).addEventListener("click", () => this.#ask({ type }));
    }
    byId("route-add").addEventListener("click", () => tools.choose("route", { focus: true }));
    byId("route-remove").addEventListener("click", () => this.#send(this.#route().slice(0, -1)));
    run.on("session", ({ missions = [] }) => {
      byId("mission-name").replaceChildren(...missions.map(({ name, about }) => el("option", { value: name, title: about }, name)));
    });
    run.on("state", () => this.#refresh());
  }

  // Add a waypoint of the plane to the route under way, or begin one; `heading` in radians, null for any.
  add(x, y, heading) {
    const { localized } = this.run.state, there = inMap(localized, x, y);
    const turn = there.frame === "map" ? localized.frame[2] : 0;
    const degrees = heading === null ? null : Math.round(((heading - turn) * 180) / Math.PI) % 360;
    return this.#send([...this.#route(), [there.x, there.y, degrees]], there.frame ?? "odom");
  }

  // The waypoints of the route under way; none if something else is driven, or it has failed.
  #route() {
    if (this.#sent) return this.#sent;
    const { drive_request: mission } = this.run.state;
    const goesOn = mission?.kind === "mission" && mission.name === "route" && mission.status !== "failed";
    return goesOn ? mission.steps.map(({ places }) => places[0]) : [];
  }

  #send(waypoints, frame = this.run.state.drive_request?.steps?.[0]?.frame ?? "odom") {
    if (waypoints.length === 0) return this.#ask({ type: "skip_step" });
    this.#sent = waypoints;
    return this.#ask({ type: "set_route", waypoints, frame });
  }

  #ask(message) {
    return this.connection.request(message).catch((error) => {
      this.#sent = null;
      this.notifications.showError(error);
    });
  }

  #refresh() {
    const { drive_request: mission, hold_reason: reason } = this.run.state;
    const isOne = mission?.kind === "mission";
    if (this.#sent && isOne && mission.steps.length === this.#sent.length) this.#sent = null;
    byId("mission").hidden = !isOne;
    if (!isOne) {
      this.#shown = null;
      return;
    }
    const { name, status, steps } = mission;
    setText(byId("mission-title"), `${name}: ${status}`);
    setText(byId("mission-about"), mission.about);
    setText(byId("mission-reason"), mission.reason ?? reason ?? `${mission.step_s.toFixed(0)} s and ${this.units.number(mission.way_m)} ${this.units.name} in this step`);
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
    byId("route-remove").hidden = name !== "route" || mission.step >= steps.length - 1;
    if (!this.run.state.controller || this.run.watchesRecording) return;
    byId("mission-hold").disabled = status !== "running";
    byId("mission-resume").disabled = status !== "held";
    byId("mission-skip").disabled = ENDS.has(status);
  }
}

function stepRow({ name, schemas, until }) {
  const lead = (go) => (go === "next" ? "next step" : go);
  return el("li", {}, el("strong", {}, name), ` ${schemas.join(" + ").replaceAll("_", "-") || "stand"}`,
    el("ul", {}, ...until.map(([when, go]) => el("li", {}, `${when} → ${lead(go)}`))));
}
