// SPDX-License-Identifier: BSD-3-Clause
// The chosen body in numbers: the way to choose and place one without a mouse.

import {byId, degrees, fixed, make, radians, setText} from "../common/dom.js";

export class BodyPanel {
  /** ask(name, values): a command; say(text): for those who do not see the picture; edits: hears of what is done. */
  constructor(scene, options, permit, ask, say, edits) {
    Object.assign(this, {scene, options, permit, ask, say, edits});
    const select = byId("body-select");
    select.addEventListener("change", () => options.set({selected: select.value ? this.#bodies[select.value].id : null}));
    scene.on("world", () => this.#fill());
    scene.on("state", () => this.#show());
    options.on("change", () => this.#choose());
    permit.on("change", () => this.#choose());
    byId("place").addEventListener("input", () => (this.#typed = true));
    byId("place").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#place();
    });
    byId("delete").addEventListener("click", () => this.#chosen && edits.remove(this.#chosen));
    this.#fill();
  }

  #bodies = [];
  #shown; // whose numbers the fields were filled with
  #typed = false; // they are somebody's own since

  get #chosen() {
    return this.#bodies.find(({id}) => id === this.options.selected) ?? null;
  }

  /** Ids may be numbers or words; the options count. */
  #fill() {
    this.#bodies = this.scene.world.bodies.filter(({kind}) => kind !== "wall");
    const entries = this.#bodies.map(({name, kind}, i) => make("option", {value: String(i), textContent: `${name} (${kind})`}));
    byId("body-select").replaceChildren(make("option", {value: "", textContent: "none"}), ...entries);
    this.#choose();
  }

  #choose() {
    const body = this.#chosen;
    byId("body-select").value = body ? String(this.#bodies.indexOf(body)) : "";
    const usable = Boolean(body?.movable) && this.permit.can("set_pose");
    byId("place-fields").disabled = !usable;
    byId("delete").disabled = !body?.movable || !this.permit.can("delete");
    let why = this.permit.why;
    if (!body) why = "Choose a body here, or click on one in the picture.";
    else if (!why && !body.movable) why = "This body cannot be moved.";
    else if (!why && !usable) why = "This source cannot move bodies.";
    setText(byId("place-why"), why);
    this.#show();
  }

  #show() {
    const body = this.#chosen;
    const pose = body && this.scene.poseOf(body);
    const text = pose ? `${fixed(pose[0], 3)} m, ${fixed(pose[1], 3)} m, ${fixed(degrees(pose[2]), 1)}°` : "–";
    setText(byId("body-pose"), text);
    setText(byId("body-hit"), body ? (this.scene.touches(body) ? "touches something" : "none") : "–");
    if (body?.id !== this.#shown) this.#typed = false;
    this.#shown = body?.id;
    if (pose && !this.#typed) this.#write(pose);
  }

  /** The form follows the body, until somebody types. */
  #write([x, y, yaw]) {
    for (const [name, text] of Object.entries({x: x.toFixed(3), y: y.toFixed(3), yaw: degrees(yaw).toFixed(1)})) {
      const field = byId(`place-${name}`);
      if (field.value !== text && document.activeElement !== field) field.value = text;
    }
  }

  async #place() {
    const [x, y, yaw] = ["x", "y", "yaw"].map((name) => byId(`place-${name}`).valueAsNumber);
    const body = this.#chosen;
    const before = this.scene.poseOf(body);
    const reply = await this.ask("set_pose", {body: body.id, x, y, yaw: radians(yaw)});
    if (!reply.ok) return;
    if (before) this.edits.moved(body, before, [x, y, radians(yaw)]);
    this.#typed = false;
    this.say(`${body.name} was moved there.`);
  }
}
