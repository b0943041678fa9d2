// SPDX-License-Identifier: BSD-3-Clause
// The frames of tf as a tree, listed when asked: to listen all the time would cost a fast simulator something.

import {byId, make, setText} from "../common/dom.js";

export class Frames {
  constructor(scene, ask) {
    Object.assign(this, {ask});
    byId("frames-list").addEventListener("click", () => this.#list());
    scene.on("hello", ({open}) => (byId("frames").hidden = !open?.includes("frames")));
  }

  async #list() {
    const button = byId("frames-list");
    button.disabled = true;
    setText(button, "Listening");
    const reply = await this.ask("frames");
    button.disabled = false;
    setText(button, "List frames");
    if (!reply.ok) return;
    const frames = JSON.parse(reply.result);
    byId("frames-tree").replaceChildren(...this.#rows(frames));
    setText(byId("frames-count"), frames.length ? `${frames.length} transforms` : "nobody publishes transforms");
  }

  #rows(frames) {
    const children = new Map();
    for (const frame of frames) children.set(frame.parent, [...(children.get(frame.parent) ?? []), frame]);
    const known = new Set(frames.map(({child}) => child));
    const roots = [...children.keys()].filter((parent) => !known.has(parent));
    const rows = [];
    const seen = new Set();
    const add = (frame, depth) => {
      if (seen.has(frame.child)) return;
      seen.add(frame.child);
      rows.push(row(frame.child, depth, `${frame.rate === null ? "static" : `${frame.rate.toFixed(1)} Hz`}, ${frame.node}`));
      for (const next of children.get(frame.child) ?? []) add(next, depth + 1);
    };
    for (const root of roots.sort()) {
      rows.push(row(root, 0, "root"));
      for (const frame of children.get(root)) add(frame, 1);
    }
    for (const frame of frames) add(frame, 0); // of a loop, which no tree has
    return rows;
  }
}

function row(name, depth, text) {
  const item = make("li", {}, make("code", {textContent: name}), make("span", {className: "soft", textContent: text}));
  item.style.paddingLeft = `${1.2 * depth}em`;
  return item;
}
