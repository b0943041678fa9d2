// SPDX-License-Identifier: BSD-3-Clause
// What the critic's report says is furthest off: where on the map, and when.

import {byId, make, setText} from "../common/dom.js";
import {fragment, largest, pictures, quantity, momentText} from "../report/data.js";

// Of the report's page only the data are wanted; its styles may not act here, and each would be complained about.
const STYLES = /<(style)\b[^>]*>[^]*?<\/\1>|\bstyle="[^"]*"/g;
const MARKED = 100;
const LISTED = 25;
const LARGEST = 11; // [px] radius of the mark of what is furthest off

export class Residuals {
  #address = null;
  #pictures = [];
  #marks = [];

  constructor(scene, picture, recording, tell) {
    Object.assign(this, {scene, picture, recording, tell});
    scene.on("hello", ({report}) => report && report !== this.#address && this.#load(report));
    byId("residual-picture").addEventListener("change", () => this.#choose());
    byId("residual-marks").addEventListener("change", () => picture.dirty("front"));
    picture.extras.push((context) => byId("residual-marks").checked && this.#draw(context));
  }

  async #load(address) {
    this.#address = address;
    try {
      const answer = await fetch(address);
      if (!answer.ok) throw new Error(`${answer.status}`);
      const page = new DOMParser().parseFromString((await answer.text()).replace(STYLES, ""), "text/html");
      this.#pictures = pictures(page).filter(({samples}) => samples.some(({value}) => value !== null));
    } catch (error) {
      this.tell(`The report could not be read: ${error.message}`, true);
      return;
    }
    byId("tab-report").hidden = !this.#pictures.length;
    const choices = this.#pictures.map(({title}, i) => make("option", {value: String(i), textContent: title}));
    byId("residual-picture").replaceChildren(...choices);
    this.#choose();
  }

  #choose() {
    const chosen = this.#pictures[Number(byId("residual-picture").value)];
    if (!chosen) return;
    const {samples, unit} = chosen;
    this.#marks = largest(samples, MARKED);
    setText(byId("residual-count"), `The ${Math.min(LISTED, this.#marks.length)} largest of ${samples.length} misfits in the picture:`);
    byId("residual-list").replaceChildren(...this.#marks.slice(0, LISTED).map((sample) => make("li", {},
      make("a", {href: fragment(sample), textContent: `${quantity(sample.value, unit)} ${momentText(sample)}`}))));
    this.picture.dirty("front");
  }

  /** Marks of this run are full, those of others empty; up or down: read long or short. */
  #draw(context) {
    const {camera, colors, ratio} = this.picture;
    const most = Math.abs(this.#marks[0]?.value ?? 1) || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const {run, x, y, value} of this.#marks) {
      if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
      const [px, py] = camera.toScreen(x, y);
      const size = LARGEST * Math.sqrt(Math.abs(value) / most);
      const up = value > 0 ? -1 : 1;
      context.beginPath();
      context.moveTo(px, py + up * size);
      context.lineTo(px - 0.87 * size, py - 0.5 * up * size);
      context.lineTo(px + 0.87 * size, py - 0.5 * up * size);
      context.closePath();
      Object.assign(context, {lineWidth: 1.5, strokeStyle: colors.error.at(value > 0 ? -1 : 0), fillStyle: colors.error.at(value > 0 ? -1 : 0)});
      context.globalAlpha = run === this.recording.run ? 0.55 : 0.12;
      context.fill();
      context.globalAlpha = 1;
      context.stroke();
    }
  }
}
