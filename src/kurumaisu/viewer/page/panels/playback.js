// SPDX-License-Identifier: BSD-3-Clause
// A recording: play, hold, any moment of it.

import {byId, fixed, newest, setText} from "../common/dom.js";

const NUDGE = 0.1; // [s] of a key

export class Playback {
  #held = false; // the user has the slider
  #send;
  #wanted = null; // [s] asked for, until the recording has moved there
  #before = null; // [s] where it was then

  constructor(scene, permit, ask) {
    Object.assign(this, {scene, permit});
    this.#send = newest((t) => ask("seek", {t}), (reply) => reply.ok || (this.#wanted = null));
    this.ask = ask;
    const scrubber = byId("scrubber");
    scene.on("state", () => this.#show());
    byId("play").addEventListener("click", () => this.togglePlay());
    byId("rate").addEventListener("change", (event) => ask("rate", {value: Number(event.target.value)}));
    scrubber.addEventListener("pointerdown", () => (this.#held = true));
    for (const end of ["pointerup", "pointercancel", "change"]) scrubber.addEventListener(end, () => (this.#held = false));
    scrubber.addEventListener("input", () => {
      this.seek(Number(scrubber.value));
      this.#tell(Number(scrubber.value));
    });
  }

  seek(t) {
    [this.#wanted, this.#before] = [t, this.playback.t];
    this.#send(t);
  }

  get playback() {
    return this.scene.state?.playback;
  }

  togglePlay() {
    if (this.playback && this.permit.can("play")) this.ask("play", {on: !this.playback.playing});
  }

  /** Move by a few of the smallest steps. */
  nudge(steps) {
    const {playback} = this;
    if (!playback || !this.permit.can("seek")) return;
    this.seek(Math.min(playback.to, Math.max(playback.from, (this.#wanted ?? playback.t) + steps * NUDGE)));
  }

  #show() {
    const {playback} = this;
    if (!playback) return;
    const scrubber = byId("scrubber");
    const {from, to, t, playing, rate} = playback;
    Object.assign(scrubber, {min: from, max: to, step: 0.01});
    setText(byId("play"), playing ? "Pause" : "Play");
    if (t !== this.#before) this.#wanted = null;
    if (!this.#held) {
      scrubber.value = this.#wanted ?? t;
      this.#tell(this.#wanted ?? t);
    }
    const choice = byId("rate");
    if (document.activeElement !== choice) choice.value = String(rate);
  }

  #tell(t) {
    const {from, to} = this.playback;
    const text = `${fixed(t - from, 2)} of ${fixed(to - from, 2)} s`;
    setText(byId("moment"), text);
    byId("scrubber").setAttribute("aria-valuetext", text);
  }
}
