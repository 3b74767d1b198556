// @ts-check
// The files of the run's settings: their text with what is wrong beside its lines, the difference, saving, and a
// restart.

import { messageOf } from "./connection.js";
import { button, byId, download, el, setText } from "./dom.js";
import { refuse, showIn } from "./fields.js";
import { base } from "./files.js";
import { Panel } from "./panel.js";
import { SettingsForm } from "./settings_form.js";

const CHECK_AFTER_MS = 400;

export class SettingsFiles extends Panel {
  /** @type {SettingsRow[]} */
  #rows = [];
  #at = 0;
  /** @type {SettingsText | null} */
  #held = null; // text and digest of the file, as it was opened
  #asked = 0;
  /** @type {number | undefined} */
  #timer = undefined;
  #good = false;
  #form = new SettingsForm((field, value) => void this.#setIn(field, value));

  /** @param {Panels} parts */
  constructor(parts) {
    super(parts);
    const { run } = parts;
    /** @param {string} id @param {() => void} act */
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("settings-open", () => void this.open());
    on("settings-close", () => this.#close());
    on("settings-save", () => void this.#save());
    on("settings-copy", () =>
      download(base(this.#rows[this.#at].name), new Blob([byId("settings-text").value], { type: "application/toml" })),
    );
    on("settings-restart", () => this.#restart());
    byId("settings-file").addEventListener("change", () => {
      const chosen = Number(byId("settings-file").value); // which a question puts back
      this.#leave(() => void this.#show(chosen));
    });
    const text = byId("settings-text");
    text.addEventListener("input", () => this.#changed());
    text.addEventListener("scroll", () => {
      byId("settings-lines").scrollTop = text.scrollTop;
    });
    byId("settings").addEventListener("keydown", (event) => event.key === "Escape" && this.#close());
    run.on("state", () => this.#refresh());
  }

  async open() {
    const rows = await this.ask({ type: "list_settings" });
    if (rows === undefined) return;
    this.#rows = rows;
    byId("settings-file").replaceChildren(
      ...this.#rows.map(({ kind, name, shipped }, i) =>
        el("option", { value: i }, `${kind}: ${name}${shipped ? " (comes with the program)" : ""}`),
      ),
    );
    if (!byId("settings").open) byId("settings").show();
    await this.#show(
      Math.max(
        0,
        this.#rows.findIndex(({ shipped }) => !shipped),
      ),
    );
  }

  get #isChanged() {
    return this.#held !== null && byId("settings-text").value !== this.#held.text;
  }

  /** @param {number} number */
  async #show(number) {
    this.#at = number;
    this.#held = null;
    byId("settings-file").value = String(number);
    byId("settings-text").value = "";
    byId("settings-text").readOnly = true; // what is typed before the text is here would be lost
    try {
      const held = await this.connection.request({ type: "read_settings", file: number });
      if (number === this.#at) this.#hold(held); // not that of a file that was left meanwhile
    } catch (error) {
      if (number === this.#at) setText(byId("settings-state"), messageOf(error));
    }
  }

  /** @param {SettingsText} held */
  #hold(held) {
    this.#held = { ...held, text: held.text.replaceAll("\r\n", "\n") };
    const text = byId("settings-text");
    text.value = this.#held.text;
    text.readOnly = this.#rows[this.#at].shipped;
    this.#list({ problems: [], warnings: [], difference: "", form: held.form });
    setText(
      byId("settings-state"),
      text.readOnly
        ? "It comes with the program and is not changed: download a copy, change that, and name it in the command."
        : "",
    );
    this.#refresh();
  }

  // Runs an action, after a question where it would lose a change.
  /** @param {() => void} act */
  #leave(act) {
    if (!this.#isChanged) {
      act();
      return;
    }
    byId("settings-file").value = String(this.#at);
    this.notifications.confirm(
      "Leave the change unsaved?",
      el("p", {}, `${this.#rows[this.#at].name} is changed and not saved.`),
      [
        ["Go on changing it", null],
        ["Leave it unsaved", act],
      ],
    );
  }

  #close() {
    this.#leave(() => {
      byId("settings").close();
      this.#held = null;
      byId("settings-open").focus();
    });
  }

  #changed() {
    this.#good = false;
    this.#refresh();
    this.#number([]);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => void this.#check(), CHECK_AFTER_MS);
  }

  // Changes the text by a field of the form.
  /** @param {Field} field @param {Parameter["value"]} value */
  async #setIn(field, value) {
    const text = byId("settings-text"),
      toml = text.value,
      { path } = field.parameter;
    try {
      const changed = await this.connection.request({ type: "change_settings", file: this.#at, toml, path, value });
      if (toml !== text.value) throw new Error("the text was changed meanwhile: change it once more");
      text.value = changed;
      field.parameter.value = value;
      showIn(field, value);
      this.#changed();
    } catch (error) {
      refuse(field, messageOf(error));
    }
  }

  async #check() {
    const asked = ++this.#asked,
      toml = byId("settings-text").value;
    try {
      const found = await this.connection.request({ type: "check_settings", file: this.#at, toml });
      if (asked !== this.#asked || toml !== byId("settings-text").value) return; // another check follows
      this.#good = found.problems.length === 0;
      this.#list(found);
    } catch (error) {
      setText(byId("settings-state"), messageOf(error));
    }
    this.#refresh();
  }

  /** @param {SettingsCheck} check */
  #list({ problems, warnings, difference, form }) {
    this.#form.show(form, byId("settings-text").readOnly);
    this.#number(problems.map(({ line }) => line));
    byId("settings-problems").replaceChildren(
      ...problems.map(({ line, text }) =>
        el(
          "li",
          { class: "bad" },
          line === null ? text : button(`line ${line}: ${text}`, () => this.#goTo(line), { class: "small" }),
        ),
      ),
      ...warnings.map((text) => el("li", {}, text)),
    );
    byId("settings-difference").replaceChildren(
      ...difference
        .split("\n")
        .filter(Boolean)
        .map((line) =>
          el("div", { class: /^\+(?!\+\+ )/.test(line) ? "added" : /^-(?!-- )/.test(line) ? "removed" : "" }, line),
        ),
    );
    byId("settings-difference").hidden = difference === "";
    if (this.#isChanged)
      setText(
        byId("settings-state"),
        problems.length > 0
          ? `${problems.length === 1 ? "One problem" : `${problems.length} problems`}: it is not saved like this.`
          : "Good. The difference is below.",
      );
  }

  /** @param {(number | null)[]} bad */
  #number(bad) {
    const count = byId("settings-text").value.split("\n").length;
    byId("settings-lines").replaceChildren(
      ...Array.from({ length: count }, (_, i) =>
        bad.includes(i + 1) ? el("b", { title: "there is a problem in this line" }, `✗ ${i + 1}\n`) : `${i + 1}\n`,
      ),
    );
    byId("settings-lines").scrollTop = byId("settings-text").scrollTop;
  }

  /** @param {number} line */
  #goTo(line) {
    const text = byId("settings-text"),
      lines = text.value.split("\n");
    const from = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    text.focus();
    text.setSelectionRange(from, from + lines[line - 1].length);
    text.scrollTop = (text.scrollHeight * Math.max(0, line - 5)) / lines.length;
  }

  #refresh() {
    const { controller } = this.run.state;
    byId("settings-save").disabled = !controller || !this.#isChanged || !this.#good;
    byId("settings-restart").disabled = !controller || this.run.robot.mode === "DRIVE";
    byId("settings-restart").title =
      this.run.robot.mode === "DRIVE" ? "Disarm the robot first" : controller ? "" : "Ask for control first";
  }

  async #save() {
    if (this.#held === null) return;
    try {
      this.#hold(
        await this.connection.request({
          type: "save_settings",
          file: this.#at,
          toml: byId("settings-text").value,
          digest: this.#held.digest,
        }),
      );
      byId("settings-text").focus(); // the button that had the focus is disabled now
      setText(byId("settings-state"), "Saved. It counts once the run is started again.");
    } catch (error) {
      setText(byId("settings-state"), messageOf(error));
    }
  }

  #restart() {
    this.#leave(() =>
      this.notifications.confirm(
        "Start the run again?",
        el(
          "p",
          {},
          "The run ends and begins anew with the files as they are now; its map starts empty. ",
          "A real robot stays disarmed. This page comes back by itself.",
        ),
        [
          ["Go on with this run", null],
          [
            "Start it again",
            () =>
              void this.connection.request({ type: "restart_run" }).then(
                () => {
                  byId("settings").close();
                  this.notifications.toast("The run is starting again");
                },
                (error) => setText(byId("settings-state"), error.message),
              ),
          ],
        ],
      ),
    );
  }
}
