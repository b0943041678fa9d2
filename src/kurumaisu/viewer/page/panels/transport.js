// SPDX-License-Identifier: BSD-3-Clause
// Pause, step, speed, reset, seed, record, emergency stop: what the simulator or the robot is told.

import {byId, make, setPressed, setText} from "../common/dom.js";

export class Transport {
  #seed = null; // that was shown
  #asked = false; // for a bag's beginning or end, and not answered yet

  /** ask(name, values): a command, failures are said elsewhere; stick: to be let go at a stop; say(text); restart: as ask. */
  constructor(scene, permit, ask, stick, say, restart) {
    Object.assign(this, {scene, permit, ask, stick, say, restart});
    scene.on("state", () => this.#show());
    permit.on("change", () => this.#show());
    const click = (id, action) => byId(id).addEventListener("click", action);
    click("pause", () => this.togglePause());
    click("step", () => this.step());
    click("reset", () => restart("reset"));
    click("reseed", () => this.#reseed());
    click("record", () => this.#record());
    click("estop", () => (this.stopped ? ask("estop", {on: false}) : this.stop()));
    byId("speed").addEventListener("change", (event) => ask("speed", {value: Number(event.target.value)}));
    byId("seed").addEventListener("keydown", (event) => event.key === "Enter" && this.#reseed());
  }

  get stopped() {
    return Boolean(this.scene.state?.estop);
  }

  /** Emergency stop. Keys only ever set it; letting go of it takes the button. */
  stop() {
    this.stick.drive.disarm();
    if (this.permit.can("estop")) this.ask("estop", {on: true});
  }

  togglePause() {
    if (this.permit.can("pause")) this.ask("pause", {on: !this.scene.state?.paused});
  }

  step() {
    if (!byId("step").disabled && !byId("step").hidden) this.ask("step");
  }

  async #record() {
    this.#asked = true;
    this.#show();
    const reply = await this.ask("record", {on: !this.scene.state?.recording});
    this.#asked = false;
    this.#show();
    if (reply.ok) this.say(reply.message); // where the bag is
  }

  #reseed() {
    const seed = byId("seed");
    if (seed.reportValidity() && seed.value !== "") this.restart("seed", {value: Number(seed.value)});
  }

  /** Show the speed that is wanted, whoever asked for it. */
  #showSpeed(speed) {
    const choice = byId("speed");
    if (speed == null || document.activeElement === choice) return;
    const value = String(Number(speed.toPrecision(3))); // it may have been a float of 32 bits
    if (choice.value === value) return;
    if (![...choice.options].some((option) => option.value === value)) {
      choice.append(make("option", {value, textContent: `${value}×`}));
    }
    choice.value = value;
  }

  /** Show the seed of the run, until another one is typed. */
  #showSeed(seed) {
    if (seed == null || seed === this.#seed) return;
    this.#seed = seed;
    if (document.activeElement !== byId("seed")) byId("seed").value = String(seed);
  }

  #showRecord({recording, starting}) {
    const waits = this.#asked || starting;
    const text = recording ? `Stop recording ${recording}` : "Record a bag";
    setText(byId("record"), waits ? (recording ? "Ending the bag" : "Starting to record") : text);
    setPressed(byId("record"), recording);
    byId("record").disabled = waits || !this.permit.can("record");
  }

  #show() {
    const state = this.scene.state;
    if (!state) return;
    this.#showSpeed(state.speed);
    setText(byId("pause"), state.paused ? "Run" : "Pause");
    byId("step").disabled = !this.permit.can("step") || !state.paused;
    if (this.permit.can("step")) byId("step").title = state.paused ? byId("step").dataset.title : "Pause first";
    this.#showSeed(state.seed);
    this.#showRecord(state);
    setText(byId("estop"), this.stopped ? "Stopped: release" : "E-stop");
    setPressed(byId("estop"), this.stopped);
    byId("drive").disabled = !this.permit.can("drive") || this.stopped || !this.scene.hello.limits;
  }
}
