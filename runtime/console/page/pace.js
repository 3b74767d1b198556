// @ts-check
// How fast a clock really goes: a busy machine may not reach the speed that was chosen.

const OVER_S = 3;
const SLACK = 0.1;

export class Pace {
  /** @type {{ clock: number; other: number; speed: number } | null} */
  #from = null;
  /** @type {number | null} */
  #reached = null;

  // Takes in the clock that should go `speed` times as fast as the other one, both in s; null where it stands.
  // Returns the speed of the last seconds, null where it is what was chosen or not known yet.
  /** @param {number} clock @param {number} other @param {number | null} speed */
  measure(clock, other, speed) {
    const from = this.#from;
    if (speed === null || from === null || from.speed !== speed || clock < from.clock || other < from.other) {
      this.#from = speed === null ? null : { clock, other, speed };
      this.#reached = null;
    } else if (other - from.other > OVER_S) {
      const pace = (clock - from.clock) / (other - from.other);
      this.#reached = Math.abs(pace - speed) > SLACK * speed ? pace : null;
      this.#from = { clock, other, speed };
    }
    return this.#reached;
  }
}

/** @param {number} speed @param {number | null} reached */
export const paceText = (speed, reached) =>
  `× ${speed}${reached === null ? "" : ` (this machine reaches × ${reached.toFixed(1)})`}`;
