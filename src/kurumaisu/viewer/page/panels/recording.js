// SPDX-License-Identifier: BSD-3-Clause
// The runs of a recording, and their ways from beginning to end.

import {byId, make} from "../common/dom.js";

const DASHES = {odom: [7, 4]};

export class Recording {
  #paths = [];
  #runs = "";

  constructor(scene, connection, picture, ask) {
    Object.assign(this, {scene, picture});
    window.name = "kurumaisu-viewer"; // the report leads to this window
    connection.on("message", (message) => message.type === "paths" && this.#take(message));
    scene.on("state", () => this.#show());
    byId("run").addEventListener("change", (event) => ask("run", {run: event.target.value}));
    picture.extras.push((context) => this.#draw(context));
  }

  get run() {
    return this.scene.state?.playback?.run ?? null;
  }

  #take({lines}) {
    this.#paths = lines.map(({body, points}) => {
      const path = new Path2D();
      let down = false;
      for (const point of points) {
        if (point && down) path.lineTo(...point);
        else if (point) path.moveTo(...point);
        down = point !== null;
      }
      return {body, path};
    });
    this.picture.dirty("front");
  }

  #show() {
    const {run, runs} = this.scene.state?.playback ?? {};
    const choice = byId("run");
    choice.parentElement.hidden = !runs || runs.length < 2;
    if (!runs) return;
    const key = JSON.stringify(runs);
    if (key !== this.#runs) {
      this.#runs = key;
      choice.replaceChildren(...runs.map((name) => make("option", {value: name, textContent: name})));
    }
    if (document.activeElement !== choice) choice.value = run;
  }

  #draw(context) {
    const {camera, colors, ratio, options} = this.picture;
    if (!options.layers.trails) return;
    camera.apply(context, ratio);
    for (const {body, path} of this.#paths) {
      if (options.layers[body] === false) continue; // truth and odometry have a switch
      const pixel = 1 / camera.scale;
      context.setLineDash((DASHES[body] ?? []).map((length) => length * pixel));
      context.globalAlpha = 0.55;
      Object.assign(context, {lineWidth: 1.5 * pixel, strokeStyle: colors[body] ?? this.scene.body(body)?.color ?? colors.soft});
      context.stroke(path);
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }
}
