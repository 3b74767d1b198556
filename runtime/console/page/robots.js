// @ts-check
// The other robots of the local network: name, mode, and a link to the page of each. What they say is not trusted: it
// is shown as text, and a link leads only to a page by its address.

import { byId, el, setText } from "./dom.js";

const ADDRESS = /^http:\/\/[0-9.]{7,15}:[0-9]{1,5}\/$/;

export class Robots {
  /** @param {Pick<Parts, "run" | "connection">} parts */
  constructor({ run, connection }) {
    run.on("session", ({ robots }) => this.#show(robots ?? []));
    connection.on("robots", ({ robots }) => this.#show(robots));
  }

  /** @param {RobotRow[]} robots */
  #show(robots) {
    byId("robots-part").hidden = robots.length === 0;
    setText(byId("robots-count"), `${robots.length}`);
    byId("robots").replaceChildren(
      ...robots
        .filter(({ url }) => ADDRESS.test(url))
        .map(({ name, mode, url }) =>
          el(
            "li",
            {},
            el("a", { href: url, target: "_blank", rel: "noopener noreferrer" }, name),
            ` ${mode.replace("_", " ")} `,
            el("span", { class: "hint" }, url.slice("http://".length, -1)),
          ),
        ),
    );
  }
}
