// Feet or metres: the wire is SI; everything displayed is in the chosen unit.

import { Emitter } from "./emitter.js";

const METRES_A_FOOT = 0.3048;

export class Units extends Emitter {
  name = "m";

  choose(name) {
    this.name = name === "ft" ? "ft" : "m";
    this.emit("changed");
  }

  get metres() {
    return this.name === "ft" ? METRES_A_FOOT : 1;
  }

  get word() {
    return this.name === "ft" ? "feet" : "metres";
  }

  number(metres, digits = 2) {
    return (metres / this.metres).toFixed(digits).replace("-", "−");
  }

  length(metres, digits = 2) {
    return `${this.number(metres, digits)} ${this.name}`;
  }

  place(x, y, digits = 2) {
    return `${this.number(x, digits)}, ${this.number(y, digits)} ${this.name}`;
  }

  parse(text) {
    const value = Number(text.trim().replace("−", "-").replace(",", "."));
    return text.trim() === "" || !Number.isFinite(value) ? null : value * this.metres;
  }
}

// From −180° to 180°, however often the robot has turned.
export const degrees = (radians) => `${Math.round((Math.atan2(Math.sin(radians), Math.cos(radians)) * 180) / Math.PI)}°`.replace("-", "−");
