// SPDX-License-Identifier: BSD-3-Clause
// Who may do what: a command that the source does not know has no control; one that is not ours is there, and says why not.

import {News} from "../common/dom.js";

const OFF = "Not connected";
const ASKING = "Asking for control";
const CLOSED = "View only: the viewer was started without control; start it with viewer_control:=true.";
const NO_TOKEN = "View only: to take control, open the link that the viewer printed at its start";
const OR_NEW = ", or the one that this prints:";

/** News: "change". */
export class Permit extends News {
  #line = false;

  constructor(scene, connection) {
    super();
    Object.assign(this, {scene, connection});
    connection.on("refused", () => this.#apply());
    scene.on("hello", () => this.#apply());
    connection.on("line", ({state}) => {
      this.#line = state === "on";
      if (!this.#line) this.#apply(); // otherwise hello comes at once
    });
  }

  /** Say why nothing may be commanded, or nothing. */
  get why() {
    const hello = this.scene.hello;
    if (!this.#line || !hello) return OFF;
    if (!hello.control && this.connection.asking) return ASKING;
    if (hello.control) return "";
    if (!hello.abilities.length) return CLOSED;
    return this.command ? NO_TOKEN + OR_NEW : `${NO_TOKEN}.`;
  }

  /** The command that prints a link with a token, for who has none; "" where there is none. */
  get command() {
    const hello = this.scene.hello;
    return this.#line && hello && !hello.control && hello.abilities.length && !this.connection.asking ? hello.new_token ?? "" : "";
  }

  /** Say so to everybody, not only on a control. */
  get notice() {
    return this.#line && !this.connection.asking ? this.why : "";
  }

  knows(name) {
    return this.scene.hello?.abilities.includes(name) ?? false;
  }

  can(name) {
    return this.knows(name) && !this.why;
  }

  #apply() {
    const mode = this.scene.hello?.mode ?? "none";
    document.body.dataset.mode = mode;
    for (const element of document.querySelectorAll("[data-only]")) element.hidden = element.dataset.only !== mode;
    for (const element of document.querySelectorAll("[data-needs]")) {
      const name = element.dataset.needs;
      const keep = element.hasAttribute("data-keep") && mode !== "bag";
      element.hidden = !this.knows(name) && !keep;
      if (element.getAttribute("role") === "tab" || element.tagName === "LABEL") continue; // what is in it tells
      if (element.tagName === "FORM") element.firstElementChild.disabled = !this.can(name);
      else element.disabled = !this.can(name);
      element.dataset.title ??= element.title;
      const why = this.command ? `${this.why} ${this.command}` : this.why;
      element.title = this.can(name) ? element.dataset.title : why || "This source does not have this command";
    }
    this.tell("change");
  }
}
