// SPDX-License-Identifier: BSD-3-Clause
// Where a robot is to go: set with a tool, told to who navigates, and driven to where the source can.

import {byId, degrees, fixed, setText} from "../common/dom.js";

const ARROW = 34; // [px]
const HEAD = 9;

export class GoalPanel {
  /** ask(name, values): a command; body(): id of the robot that is driven, or null for the only one. */
  constructor(scene, picture, permit, ask, say, body) {
    Object.assign(this, {scene, picture, permit, ask, say, body});
    byId("go").addEventListener("click", () => this.#go());
    byId("forget-goal").addEventListener("click", () => ask("forget_goal"));
    scene.on("state", () => this.#show());
    permit.on("change", () => this.#show());
    picture.extras.push((context) => this.#draw(context));
    this.#show();
  }

  /** Set a goal at a place [m], heading along a vector. */
  async set([x, y], [dx, dy]) {
    const reply = await this.ask("goal", {x, y, yaw: Math.atan2(dy, dx)});
    if (reply.ok) this.say(`The goal was ${reply.message}.`);
  }

  #go() {
    const body = this.body();
    this.ask("go", body === null ? {} : {body});
  }

  get #goal() {
    return this.scene.state?.goal ?? null;
  }

  #show() {
    const goal = this.#goal;
    byId("goal-box").hidden = !goal;
    if (!goal) return;
    const [x, y, yaw] = goal.pose;
    setText(byId("goal-pose"), `${fixed(x, 2)} m, ${fixed(y, 2)} m, ${fixed(degrees(yaw), 0)}°`);
    const name = this.scene.body(goal.body)?.name;
    setText(byId("goal-text"), goal.text ? `${name ? `${name}: ` : ""}${goal.text}` : "");
    byId("go").hidden = !this.permit.knows("go") || goal.driving;
    byId("go").disabled = !this.permit.can("go") || Boolean(this.scene.state.estop);
    setText(byId("forget-goal"), goal.driving ? "Stop" : "Clear");
    byId("forget-goal").disabled = !this.permit.can("forget_goal");
  }

  #draw(context) {
    const goal = this.#goal;
    if (!goal) return;
    const {camera, colors, ratio} = this.picture;
    const [px, py] = camera.toScreen(...goal.pose);
    context.setTransform(ratio, 0, 0, ratio, ratio * px, ratio * py);
    context.rotate(-goal.pose[2]);
    context.beginPath();
    context.arc(0, 0, 6, 0, 2 * Math.PI);
    context.moveTo(6, 0);
    context.lineTo(ARROW, 0);
    context.moveTo(ARROW - HEAD, -HEAD / 2);
    context.lineTo(ARROW, 0);
    context.lineTo(ARROW - HEAD, HEAD / 2);
    for (const [lineWidth, strokeStyle] of [[6, colors.paper], [2.5, colors.mark]]) {
      Object.assign(context, {lineWidth, strokeStyle, lineCap: "round", lineJoin: "round"});
      context.stroke();
    }
    Object.assign(context, {lineCap: "butt", lineJoin: "miter"});
  }
}
