// SPDX-License-Identifier: BSD-3-Clause
// A report leads here by an address with a moment and a place: #run=drive&t=12.5&x=1.0&y=2.0

const RING = 22; // [px]
const CLOSE = 60; // [px/m] at least: the place shall be seen

export class Places {
  #place = null;
  #gone = false;
  #moment = null; // to go to, once we may

  constructor(picture, scene, permit, options, bag) {
    Object.assign(this, {picture, permit, options, bag});
    // not again after a reconnect: the user has long been elsewhere
    scene.on("hello", () => this.#gone || this.go());
    permit.on("change", () => this.#seek());
    scene.on("state", () => this.#seek());
    picture.extras.push((context) => this.#place && this.#draw(context));
  }

  go() {
    this.#gone = true;
    const values = new URLSearchParams(location.hash.slice(1));
    const [t, x, y] = ["t", "x", "y"].map((name) => Number.parseFloat(values.get(name)));
    this.#moment = {run: values.get("run"), t};
    this.#seek();
    if (!Number.isFinite(x) || !Number.isFinite(y)) return;
    const {camera} = this.picture;
    Object.assign(camera, {x, y, scale: Math.max(camera.scale, CLOSE)});
    this.#place = [x, y];
    this.picture.fitted = true;
    this.options.set({follow: null});
  }

  /** The first greeting comes before we have shown that we may command. */
  #seek() {
    if (!this.#moment || !this.bag.playback || !this.permit.can("seek")) return;
    const {run, t} = this.#moment;
    this.#moment = null;
    if (run !== null) this.bag.ask("run", {run}); // commands are obeyed in turn
    if (Number.isFinite(t)) this.bag.ask("seek", {t});
  }

  #draw(context) {
    const {camera, colors, ratio} = this.picture;
    const [px, py] = camera.toScreen(...this.#place);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const [lineWidth, strokeStyle] of [[6, colors.paper], [3, colors.accent]]) {
      Object.assign(context, {lineWidth, strokeStyle});
      context.beginPath();
      context.arc(px, py, RING, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}
