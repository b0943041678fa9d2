// SPDX-License-Identifier: BSD-3-Clause
// The keys: one table, which acts and which the help shows.

const PAN = 60; // [px]
const ZOOM = 1.25;
const TURN = Math.PI / 36;

/** Return [{keys, shown, meaning, act, onMap, control}]; onMap: only while the picture, or nothing, has the focus. */
export function keyTable({picture, options, transport, bag, stick, edit, pointer, tabs, follow, chosen, edits}) {
  const {camera} = picture;
  const moved = () => picture.dirty();
  const pan = (dx, dy) => () => {
    camera.pan(dx, dy);
    options.set({follow: null});
  };
  const zoom = (factor) => () => {
    camera.zoom(factor);
    moved();
  };
  const turn = (angle) => () => {
    const body = chosen();
    if (body?.movable && picture.scene.poseOf(body)) edit.turn(body, angle);
  };
  return [
    {keys: [" "], shown: "Space", meaning: "emergency stop", act: () => transport.stop(), onMap: true},
    {
      keys: ["p"], shown: "p", meaning: "pause or run; play or pause a recording",
      act: () => (bag.playback ? bag.togglePlay() : transport.togglePause()),
    },
    {
      keys: ["."], shown: ".", meaning: "one step of a paused simulation; 0.1 s on in a recording",
      act: () => (bag.playback ? bag.nudge(1) : transport.step()),
    },
    {keys: [","], shown: ",", meaning: "0.1 s back in a recording", act: () => bag.nudge(-1)},
    // none of the keys that drive: who holds those while the stick is taken away must not take it again
    {keys: ["t"], shown: "t", meaning: "start or end driving", act: () => stick.toggle()},
    {shown: "Arrows, W A S D", meaning: "after t: hold to drive; let go to stop. Any other key stops"},
    {keys: ["ArrowUp"], act: pan(0, PAN), onMap: true},
    {keys: ["ArrowDown"], act: pan(0, -PAN), onMap: true},
    {keys: ["ArrowLeft"], act: pan(PAN, 0), onMap: true},
    {keys: ["ArrowRight"], shown: "Arrows", meaning: "move the view", act: pan(-PAN, 0), onMap: true},
    {keys: ["-"], act: zoom(1 / ZOOM)},
    {keys: ["+", "="], shown: "+ −", meaning: "zoom; also the wheel, or two fingers", act: zoom(ZOOM)},
    {keys: ["0"], shown: "0", meaning: "show everything", act: () => picture.fit()},
    {keys: ["f"], shown: "f", meaning: "follow the chosen robot, else the chair", act: follow},
    {keys: ["["], act: turn(TURN)},
    {keys: ["]"], shown: "[ ]", meaning: "turn the chosen body by 5°", act: turn(-TURN)},
    {
      keys: ["Delete", "Backspace"], shown: "Del", meaning: "delete the chosen body", onMap: true,
      act: () => chosen()?.movable && edits.remove(chosen()),
    },
    {keys: ["z"], control: true, shown: "Ctrl Z", meaning: "undo adding, deleting, moving", act: () => edits.undo()},
    {keys: ["y"], control: true, shown: "Ctrl Y", meaning: "redo", act: () => edits.redo()},
    {
      keys: ["m"], shown: "m", meaning: "measure: drag in the picture",
      act: () => options.set({tool: options.tool === "measure" ? null : "measure"}),
    },
    {keys: ["e"], shown: "e", meaning: "effects", act: () => tabs.show("effects")},
    {keys: ["v"], shown: "v", meaning: "what the picture shows", act: () => tabs.show("view")},
    {
      keys: ["Escape"], shown: "Esc", meaning: "end driving; cancel a drag",
      act: () => {
        stick.drive.disarm();
        pointer.cancel();
        edit.forgetArrow();
        options.set({tool: null});
      },
    },
    {keys: ["?"], shown: "?", meaning: "this list", act: () => document.getElementById("help-dialog").showModal()},
    {
      shown: "drag, tap",
      meaning: "on a body: choose and move it (a finger: tap it first); on its round handle: turn it; elsewhere: move the view",
    },
  ];
}

export function listen(table) {
  addEventListener("keydown", (event) => {
    if (event.altKey || event.defaultPrevented) return;
    const control = event.ctrlKey || event.metaKey;
    if (document.querySelector("dialog[open]")) return;
    const target = event.target;
    const focused = target.closest("button, input, select, textarea, summary, a");
    const writing = target.closest("select, textarea, input:not([type=checkbox], [type=radio], [type=range])");
    if (writing && event.key !== "Escape") return;
    let key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (control && event.shiftKey && key === "z") key = "y";
    const entry = table.find((one) => one.keys?.includes(key) && Boolean(one.control) === control);
    if (!entry || (entry.onMap && focused)) return;
    event.preventDefault();
    entry.act();
  });
}
