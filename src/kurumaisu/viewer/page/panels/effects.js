// SPDX-License-Identifier: BSD-3-Clause
// The catalogue of effects: search, switches, and a model file of what acts.

import {byId, make, setText} from "../common/dom.js";
import {EffectRow} from "./effect_row.js";
import {download} from "../common/download.js";

const FAMILIES = {base: "The base", laser: "The laser", world: "The world"};

export class Effects {
  #rows = new Map();
  #key = ""; // the ids that there are rows for

  /** permit: who may do what; ask(name, values): a command, failures are said; say(text). */
  constructor(scene, permit, ask, say) {
    Object.assign(this, {scene, permit, ask, say});
    scene.on("effects", () => this.#take());
    permit.on("change", () => this.#rows.forEach((row) => row.permit()));
    byId("effect-search").addEventListener("input", () => this.#filter());
    byId("effect-active").addEventListener("change", () => this.#filter());
    byId("effects-off").addEventListener("click", () => this.#rows.forEach((row) => row.off()));
    byId("save-model").addEventListener("click", () => this.#save());
  }

  #take() {
    const groups = this.scene.effects;
    const key = groups.map(({id}) => id).join("\n");
    if (key !== this.#key) this.#build(groups, key);
    else groups.forEach((group) => this.#rows.get(group.id).take(group));
    this.#filter();
  }

  #build(groups, key) {
    this.#key = key;
    const tools = {
      send: (values) => this.ask("effect", values),
      usable: () => this.permit.can("effect"),
    };
    this.#rows = new Map(groups.map((group) => [group.id, new EffectRow(group, tools)]));
    const families = Map.groupBy(groups, ({id}) => id.split(".")[0]);
    byId("effects").replaceChildren(...[...families].map(([family, members], i) =>
      make("section", {aria: {labelledby: `family-${i}`}},
        make("h2", {id: `family-${i}`, textContent: FAMILIES[family] ?? family}),
        ...members.map(({id}) => this.#rows.get(id).row))));
  }

  #filter() {
    const words = byId("effect-search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const only = byId("effect-active").checked;
    let [shown, active] = [0, 0];
    for (const row of this.#rows.values()) {
      const seen = row.matches(words) && (!only || row.active);
      row.row.hidden = !seen;
      shown += seen;
      active += row.active;
    }
    for (const section of byId("effects").children) {
      section.hidden = ![...section.children].some((child) => child.matches(".effect-row") && !child.hidden);
    }
    const all = this.#rows.size;
    setText(byId("effect-count"), `${shown === all ? all : `${shown} of ${all}`} effects, ${active} on`);
  }

  async #save() {
    const reply = await this.ask("save_model");
    if (!reply.ok) return;
    download(new Blob([reply.result], {type: "application/yaml"}), "model.yaml");
    this.say("Saved as model.yaml, with the active effects.");
  }
}
