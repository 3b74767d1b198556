// @ts-check
// What the panels share: the run, the units, the connection, and how a command is sent whose refusal is shown.

export class Panel {
  /** @param {Panels} parts */
  constructor({ run, units, connection, notifications }) {
    this.run = run;
    this.units = units;
    this.connection = connection;
    this.notifications = notifications;
  }

  // Whether this page controls the live run, and shows it.
  get enabled() {
    return this.run.state.controller && !this.run.watchesRecording;
  }

  // Sends a command; undefined if it was refused, which is shown.
  /** @template {keyof Commands} K @param {Ask<K>} message @returns {Promise<Answers[K] | undefined>} */
  async ask(message) {
    try {
      return await this.connection.request(message);
    } catch (error) {
      this.notifications.showError(error);
      return undefined;
    }
  }
}
