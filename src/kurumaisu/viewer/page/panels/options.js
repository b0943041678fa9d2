// SPDX-License-Identifier: BSD-3-Clause
// What is shown and how. The controls of the page hold the values to begin with.

import {News, byId, setPressed} from "../common/dom.js";

const TOOLS = ["measure", "estimate", "goal", "box", "wall", "person"]; // as their buttons are called

/** News: "change". */
export class Options extends News {
  layers = {};
  scanColor = "";
  errorScale = 0;
  follow = null; // id of a body
  selected = null; // id of a body
  tool = null; // one of TOOLS, or null: choose and move

  constructor() {
    super();
    for (const box of document.querySelectorAll("[data-layer]")) {
      this.#bind(box, () => (this.layers[box.dataset.layer] = box.checked));
    }
    for (const radio of document.querySelectorAll("[name=scan-color]")) {
      this.#bind(radio, () => radio.checked && (this.scanColor = radio.value));
    }
    const scale = byId("error-scale");
    this.#bind(scale, () => (this.errorScale = Number(scale.value)));
    for (const tool of TOOLS) {
      byId(tool).addEventListener("click", () => this.set({tool: this.tool === tool ? null : tool}));
    }
  }

  set(values) {
    Object.assign(this, values);
    for (const tool of TOOLS) setPressed(byId(tool), this.tool === tool);
    setPressed(byId("follow"), this.follow !== null);
    this.tell("change");
  }

  #bind(control, read) {
    read();
    control.addEventListener("change", () => {
      read();
      this.tell("change");
    });
  }
}
