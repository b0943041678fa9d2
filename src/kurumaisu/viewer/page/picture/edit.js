// SPDX-License-Identifier: BSD-3-Clause
// Choosing, moving and turning bodies; what is drawn with a tool: a distance, a pose, something to be added.

import {newest, short} from "../common/dom.js";
import {label} from "./names.js";
import {covers} from "../scene/shapes.js";

const HANDLE = 26; // [px] from a body's edge to the handle that turns it
const AT_ONCE = ["box", "wall", "person"]; // tools that do something with a click, too
const GRIP = {mouse: 10, pen: 12, touch: 22}; // [px] radius in which handle and small bodies are hit

export class Edit {
  #ghost = null; // {body, pose} that is asked for
  #arrow = null; // {from, to, kind} of a tool
  #held = false;
  #way = null; // {body, before, after} that is asked for, and whether some of it was done
  #told = ""; // why some of it was refused, which was said

  /**
   * can(name): may this command be given now? ask(name, values): gives it; resolves with its reply; moved(body, before,
   * after): hears of poses; drawn(tool, from, to): of places.
   */
  constructor(picture, scene, options, {can, ask, failed, moved, drawn}) {
    Object.assign(this, {picture, scene, options, can, moved, drawn});
    this.place = newest(
      async (body, [x, y, yaw]) => {
        const reply = await ask("set_pose", {body, x, y, yaw});
        if (reply.ok && this.#way) this.#way.done = true;
        return reply;
      },
      (reply) => {
        if (!this.#held) {
          this.#ghost = null;
          this.#record();
        }
        if (!reply.ok && reply.message !== this.#told) failed(this.#told = reply.message);
        picture.dirty("front");
      },
    );
    picture.extras.push((context) => this.#draw(context));
  }

  /** Turn a body by an angle. */
  turn(body, angle) {
    if (this.#way?.body.id !== body.id) this.#record();
    const before = this.scene.poseOf(body);
    const [x, y, yaw] = this.#way?.after ?? before;
    const after = [x, y, Math.atan2(Math.sin(yaw + angle), Math.cos(yaw + angle))];
    this.#way = {...this.#way ?? {body, before}, after};
    this.#told = "";
    this.place(body.id, after);
  }

  /** Tell of a move that is over, if there is one. */
  #record() {
    if (this.#way?.done) this.moved(this.#way.body, this.#way.before, this.#way.after);
    this.#way = null;
  }

  /** Return what a press at a place of the picture takes, or null. */
  grab(px, py, type) {
    const at = this.picture.camera.toWorld(px, py);
    if (this.options.tool) return this.#pull(at);
    if (!this.can("set_pose")) return null;
    const chosen = this.#chosen();
    if (chosen?.movable && this.#onHandle(chosen, px, py, type)) return this.#turn(chosen);
    const body = this.bodyAt(...at, type);
    // a finger that wants to move the view often lands on something: it must be chosen first
    if (!body?.movable || (type === "touch" && body !== chosen)) return null;
    this.options.set({selected: body.id});
    return this.#move(body, at);
  }

  click(px, py) {
    const at = this.picture.camera.toWorld(px, py);
    this.#arrow = null;
    if (AT_ONCE.includes(this.options.tool)) return this.drawn(this.options.tool, at, at);
    const body = this.bodyAt(...at, "mouse");
    this.options.set({selected: body?.id ?? null});
  }

  /** The body at a place of the world: the last drawn is on top. */
  bodyAt(x, y, type) {
    const slack = (GRIP[type] ?? GRIP.mouse) / this.picture.camera.scale;
    const hit = (body) => {
      const pose = body.kind === "wall" ? null : this.scene.poseOf(body);
      return pose && covers(body, pose, x, y, Math.min(slack, Math.max(slack - body.radius, 0)));
    };
    return this.scene.world.bodies.findLast(hit) ?? null;
  }

  forgetArrow() {
    this.#arrow = null;
    this.picture.dirty("front");
  }

  #chosen() {
    return this.options.selected === null ? null : this.scene.body(this.options.selected);
  }

  #handle(body) {
    const [x, y, yaw] = this.#poseOf(body);
    const reach = body.radius * this.picture.camera.scale + HANDLE;
    const [px, py] = this.picture.camera.toScreen(x, y);
    return [px + reach * Math.cos(yaw), py - reach * Math.sin(yaw)];
  }

  #poseOf(body) {
    return this.#ghost?.body === body.id ? this.#ghost.pose : this.scene.poseOf(body);
  }

  #onHandle(body, px, py, type) {
    if (!this.#poseOf(body)) return false;
    const [hx, hy] = this.#handle(body);
    return Math.hypot(px - hx, py - hy) <= (GRIP[type] ?? GRIP.mouse);
  }

  #move(body, [x0, y0]) {
    const [bx, by, yaw] = this.scene.poseOf(body);
    return this.#drag(body, (x, y) => [bx + x - x0, by + y - y0, yaw]);
  }

  #turn(body) {
    const [bx, by] = this.scene.poseOf(body);
    return this.#drag(body, (x, y) => [bx, by, Math.atan2(y - by, x - bx)]);
  }

  /** pose(x, y): where the body shall be when the pointer is there. */
  #drag(body, pose) {
    const before = this.scene.poseOf(body);
    let moved = false;
    this.#record();
    this.#told = "";
    const put = (target, held) => {
      this.#held = held;
      this.#way = {...this.#way ?? {body, before}, after: target};
      this.#ghost = {body: body.id, pose: target};
      this.place(body.id, target);
      this.picture.dirty("front");
    };
    return {
      move: (px, py) => {
        moved = true;
        put(pose(...this.picture.camera.toWorld(px, py)), true);
      },
      end: () => put(this.#ghost.pose, false),
      cancel: () => {
        if (moved) put(before, false);
        this.#way = null; // it is as before
      },
    };
  }

  #pull(from) {
    const kind = this.options.tool;
    const drop = () => this.forgetArrow();
    return {
      move: (px, py) => {
        this.#arrow = {from, to: this.picture.camera.toWorld(px, py), kind};
        this.picture.dirty("front");
      },
      end: () => {
        if (kind === "measure") return;
        this.drawn(kind, from, this.#arrow.to);
        drop();
      },
      cancel: drop,
    };
  }

  #draw(context) {
    const {camera, colors, ratio} = this.picture;
    if (this.#ghost) this.#drawGhost(context);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const chosen = this.#chosen();
    if (chosen?.movable && this.can("set_pose") && this.#poseOf(chosen)) this.#drawHandle(context, chosen);
    if (!this.#arrow) return;
    const {from, to, kind} = this.#arrow;
    const [[x0, y0], [x1, y1]] = [camera.toScreen(...from), camera.toScreen(...to)];
    if (kind === "box") frame(context, x0, y0, x1, y1, colors);
    else line(context, x0, y0, x1, y1, colors);
    Object.assign(context, {font: "12px system-ui, sans-serif", textAlign: "left", textBaseline: "bottom"});
    label(context, measures(this.#arrow), x1 + 10, y1 - 6, colors);
  }

  #drawGhost(context) {
    const {camera, colors, ratio} = this.picture;
    const body = this.scene.body(this.#ghost.body);
    if (!body) return;
    camera.apply(context, ratio);
    context.translate(this.#ghost.pose[0], this.#ghost.pose[1]);
    context.rotate(this.#ghost.pose[2]);
    Object.assign(context, {strokeStyle: colors.accent, lineWidth: 1.5 / camera.scale});
    context.setLineDash([4 / camera.scale, 3 / camera.scale]);
    context.stroke(body.closed);
    context.setLineDash([]);
  }

  #drawHandle(context, body) {
    const {camera, colors} = this.picture;
    const [hx, hy] = this.#handle(body);
    const [px, py] = camera.toScreen(...this.#poseOf(body));
    line(context, px, py, hx, hy, colors);
    context.beginPath();
    context.arc(hx, hy, 7, 0, 2 * Math.PI);
    Object.assign(context, {fillStyle: colors.paper, strokeStyle: colors.accent, lineWidth: 2.5});
    context.fill();
    context.stroke();
  }
}

/** What a person wants to know of what is drawn: the size of a box, the direction of a pose, or both. */
function measures({from, to, kind}) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  if (kind === "box") return `${short(Math.abs(dx))} m × ${short(Math.abs(dy))} m`;
  const angle = `${short((Math.atan2(dy, dx) * 180) / Math.PI)}°`;
  return kind === "estimate" || kind === "goal" ? angle : `${short(Math.hypot(dx, dy))} m, ${angle}`;
}

function frame(context, x0, y0, x1, y1, colors) {
  context.beginPath();
  context.rect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
  Object.assign(context, {strokeStyle: colors.accent, lineWidth: 1.5});
  context.stroke();
}

function line(context, x0, y0, x1, y1, colors) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  Object.assign(context, {strokeStyle: colors.accent, lineWidth: 1.5});
  context.stroke();
}
