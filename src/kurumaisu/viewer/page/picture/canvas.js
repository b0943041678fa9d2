// SPDX-License-Identifier: BSD-3-Clause
// Two canvases on top of each other: what rests and what moves. Each is drawn at most once a frame of the screen,
// and only when something in it has changed.

import {Camera} from "./camera.js";
import {readColors} from "./colors.js";
import {drawBodies, drawMarks} from "./bodies.js";
import {drawGrid, drawWalls} from "./ground.js";
import {covered, drawLegend} from "./legend.js";
import {drawMap} from "./map.js";
import {drawNames} from "./names.js";
import {drawFans, drawScans} from "./scans.js";
import {drawParticles, drawPoses, drawTrails} from "./traces.js";

export class Picture {
  camera = new Camera();
  colors = null;
  extras = []; // functions (context, picture) that draw above all: tools
  #dirty = new Set();
  #asked = false;
  #whole = ""; // place of the camera when everything was shown
  fitted = false; // once is enough: a map that grows must not move the view

  constructor(ground, front, scene, options) {
    Object.assign(this, {ground, front, scene, options});
    this.colors = readColors();
    new ResizeObserver(() => this.#resize()).observe(front);
    scene.on("world map", () => this.#placed());
    scene.on("state", () => this.#followed());
    scene.on("scan", () => this.dirty("front"));
    options.on("change", () => this.dirty());
    this.#resize();
  }

  /** Ask for "ground" or "front", or for both, to be drawn. */
  dirty(which) {
    for (const name of which ? [which] : ["ground", "front"]) this.#dirty.add(name);
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => this.#draw());
  }

  recolor() {
    this.colors = readColors();
    this.dirty();
  }

  fit() {
    const bounds = this.#bounds();
    if (bounds) {
      this.camera.fit(bounds, ...covered(this.camera.height));
      this.#whole = this.camera.place;
    }
    this.dirty();
  }

  /** Return a canvas with both, as they are seen. */
  flat() {
    this.#draw();
    const whole = document.createElement("canvas");
    [whole.width, whole.height] = [this.front.width, this.front.height];
    const context = whole.getContext("2d");
    context.drawImage(this.ground, 0, 0);
    context.drawImage(this.front, 0, 0);
    return whole;
  }

  #bounds() {
    if (this.scene.world.bounds) return this.scene.world.bounds;
    const map = this.scene.map;
    if (!map) return null;
    const [x, y] = map.origin;
    return [x, y, x + map.width * map.resolution, y + map.height * map.resolution];
  }

  #placed() {
    if (!this.fitted && this.#bounds()) {
      this.fitted = true;
      this.fit();
    }
    this.dirty();
  }

  #followed() {
    const {follow} = this.options;
    const body = follow && this.scene.body(follow);
    const pose = body && this.scene.poseOf(body);
    if (pose && (pose[0] !== this.camera.x || pose[1] !== this.camera.y)) {
      [this.camera.x, this.camera.y] = pose;
      this.dirty("ground");
    }
    this.dirty("front");
  }

  #resize() {
    const {clientWidth, clientHeight} = this.front;
    this.ratio = devicePixelRatio || 1;
    const whole = this.#whole === this.camera.place;
    Object.assign(this.camera, {width: Math.max(clientWidth, 1), height: Math.max(clientHeight, 1)});
    for (const canvas of [this.ground, this.front]) {
      canvas.width = Math.round(this.camera.width * this.ratio);
      canvas.height = Math.round(this.camera.height * this.ratio);
    }
    if (whole) this.fit(); // what showed everything goes on to
    this.#dirty.add("ground").add("front");
    this.#draw(); // at once: a resized canvas is empty
  }

  #draw() {
    this.#asked = false;
    if (this.#dirty.has("ground")) this.#drawGround();
    if (this.#dirty.has("front")) this.#drawFront();
    this.#dirty.clear();
  }

  #drawGround() {
    const context = this.ground.getContext("2d", {alpha: false});
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = this.colors.paper;
    context.fillRect(0, 0, this.ground.width, this.ground.height);
    const {layers} = this.options;
    if (layers.map) drawMap(context, this);
    if (layers.grid) drawGrid(context, this);
    if (layers.walls) drawWalls(context, this);
  }

  #drawFront() {
    const context = this.front.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.front.width, this.front.height);
    const {layers} = this.options;
    if (layers.fans) drawFans(context, this);
    if (layers.trails) drawTrails(context, this);
    if (layers.bodies) drawBodies(context, this);
    if (layers.scans) drawScans(context, this); // echoes lie on the edges of bodies
    if (layers.particles) drawParticles(context, this);
    if (layers.marks) drawMarks(context, this);
    drawPoses(context, this);
    if (layers.names) drawNames(context, this);
    for (const extra of this.extras) extra(context, this);
    drawLegend(context, this);
  }
}
