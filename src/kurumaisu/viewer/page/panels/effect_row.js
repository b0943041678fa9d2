// SPDX-License-Identifier: BSD-3-Clause
// One effect: its switch, and behind the arrow its sliders.

import {make, newest, setText} from "../common/dom.js";
import {slider} from "./slider.js";

export class EffectRow {
  #sliders = [];
  #draft = false; // values that are not the server's: chosen before it is switched on

  /** send(values): resolves with a reply; usable(): may effects be changed? */
  constructor(group, {send, usable}) {
    this.group = group;
    this.usable = usable;
    this.send = newest(send, (reply) => {
      if (reply.ok) return;
      this.#draft = false;
      this.take(this.group);
    });
    this.toggle = make("input", {type: "checkbox", role: "switch", aria: {label: `${group.id}: ${group.title}`}});
    this.toggle.addEventListener("change", () => this.#switched());
    this.values = make("span", {className: "effect-values"});
    this.element = make("details", {className: "effect", data: {effect: group.id}},
      make("summary", {},
        make("span", {className: "effect-line"}, make("code", {textContent: group.id}), this.values),
        make("span", {className: "effect-title", textContent: group.title})));
    // beside the summary, not in it: a switch in a button has no name of its own
    this.row = make("div", {className: "effect-row"}, this.toggle, this.element);
    this.element.addEventListener("toggle", () => this.#unfold());
    this.take(group);
  }

  get active() {
    return this.toggle.checked;
  }

  /** Say whether all words are in what is written about the effect. */
  matches(words) {
    const {id, title, parameters} = this.group;
    const about = parameters.flatMap(({name, description, unit}) => [name, description, unit]);
    const text = [id, title, ...about].join(" ").toLowerCase();
    return words.every((word) => text.includes(word));
  }

  /** Show what the server says; what is being moved is left alone. */
  take(group) {
    this.group = group;
    this.toggle.checked = group.enabled;
    if (group.enabled) this.#draft = false;
    if (!this.#draft) {
      group.parameters.forEach(({value}, i) => this.#sliders[i]?.busy() || this.#sliders[i]?.show(value));
    }
    this.#summarize();
    this.permit();
  }

  permit() {
    const usable = this.usable();
    this.toggle.disabled = !usable;
    for (const {controls} of this.#sliders) for (const control of controls) control.disabled = !usable;
  }

  off() {
    if (!this.active) return;
    this.toggle.checked = false;
    this.#switched();
  }

  /** Sliders are made when they are first seen: there are hundreds. */
  #unfold() {
    if (!this.element.open || this.#sliders.length) return;
    this.#sliders = this.group.parameters.map((one) => slider(one, this.group.id, () => this.#moved()));
    this.element.append(...this.#sliders.map(({row}) => row));
    this.permit();
  }

  #moved() {
    if (this.active) this.#give();
    else this.#draft = true;
    this.#summarize();
  }

  #switched() {
    if (this.active && this.#values().every(([, value], i) => value === this.group.parameters[i].neutral)) {
      this.#choose();
    }
    this.#give();
    this.#summarize();
  }

  /** A size that is usual: with its neutral values an effect that is on does nothing. */
  #choose() {
    this.element.open = true;
    this.#unfold();
    this.group.parameters.forEach(({typical}, i) => typical === null || this.#sliders[i].show(typical));
  }

  #values() {
    return this.group.parameters.map(({name, value}, i) => [name, this.#sliders[i]?.value() ?? value]);
  }

  #give() {
    this.send({effect: this.group.id, enabled: this.active, values: Object.fromEntries(this.#values())});
  }

  #summarize() {
    this.row.classList.toggle("on", this.active);
    const units = this.group.parameters.map(({unit}) => (unit && unit !== "1" ? ` ${unit}` : ""));
    const text = this.#values().map(([name, value], i) => `${name} ${Number(value.toPrecision(3))}${units[i]}`);
    setText(this.values, this.active ? text.join(", ") : "");
  }
}
