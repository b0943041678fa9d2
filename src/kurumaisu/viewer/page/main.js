// SPDX-License-Identifier: BSD-3-Clause
// Puts the parts together. A new panel is a class in panels/, its elements and its modulepreload line in index.html, its
// name among the tabs there, and one line here. It gets the scene (what the server has said, and when that changed),
// permit (what may be commanded) and ask (which commands); panels/body.js is a short one.

import {Playback} from "./panels/playback.js";
import {BodyPanel} from "./panels/body.js";
import {Picture} from "./picture/canvas.js";
import {answer} from "./common/channel.js";
import {Connection} from "./server/connection.js";
import {byId} from "./common/dom.js";
import {Edit} from "./picture/edit.js";
import {Effects} from "./panels/effects.js";
import {download} from "./common/download.js";
import {Frames} from "./panels/frames.js";
import {GoalPanel} from "./panels/goal.js";
import {History} from "./panels/history.js";
import {keyTable, listen} from "./panels/keys.js";
import {Options} from "./panels/options.js";
import {added} from "./picture/palette.js";
import {Permit} from "./server/permit.js";
import {Places} from "./report/places.js";
import {Plot} from "./plot/plot.js";
import {Pointer} from "./picture/pointer.js";
import {Recording} from "./panels/recording.js";
import {Residuals} from "./panels/residuals.js";
import {Scene} from "./scene/scene.js";
import {setUpHelp, setUpTabs, setUpTheme} from "./panels/shell.js";
import {Status} from "./panels/status.js";
import {Stick} from "./panels/stick.js";
import {Transport} from "./panels/transport.js";

/** Take the one-time secret out of the address: it must not stay in the history. */
function takeToken() {
  const values = new URLSearchParams(location.hash.slice(1));
  const token = values.get("token");
  if (token === null) return null;
  values.delete("token");
  history.replaceState(null, "", values.size ? `#${values}` : location.pathname + location.search);
  return token;
}

const scene = new Scene();
const connection = new Connection(takeToken());
const permit = new Permit(scene, connection);
const status = new Status(scene, permit, connection);
const say = (text, bad) => status.say(text, bad);
const options = new Options();
const picture = new Picture(byId("ground"), byId("front"), scene, options);
const stick = new Stick(connection, scene, options, (text) => say(text, true));

/** Give a command; what is refused is said. */
async function ask(name, values) {
  const reply = await connection.command(name, values);
  if (!reply.ok) say(reply.message, true);
  return reply;
}
// a drag is refused at many places on its way: what counts is the last one
const quietly = (name, values) => connection.command(name, values);

const edits = new History(scene, permit, ask, say);
/** Start again; what was done to the world can be done again. */
async function restart(name, values) {
  const reply = await ask(name, values);
  if (reply.ok) edits.rewound();
}
const transport = new Transport(scene, permit, ask, stick, say, restart);
stick.emergency = () => transport.stop();
const bag = new Playback(scene, permit, ask);
new Residuals(scene, picture, new Recording(scene, connection, picture, ask), say);
/** What a tool does with two places of the world. */
async function drawn(tool, from, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  if (tool === "estimate") {
    options.set({tool: null});
    ask("initial_pose", {x: from[0], y: from[1], yaw: Math.atan2(dy, dx)});
  } else if (tool === "goal") {
    options.set({tool: null});
    goals.set(from, [dx, dy]);
  } else {
    const id = await edits.add(added(tool, from, to));
    if (id !== null) options.set({selected: id});
  }
}
const goals = new GoalPanel(scene, picture, permit, ask, say, () => stick.drive.body);
const edit = new Edit(picture, scene, options, {
  can: (name) => permit.can(name), ask: quietly, failed: (text) => say(text, true),
  moved: (...move) => edits.moved(...move), drawn,
});
const pointer = new Pointer(byId("front"), picture, {
  grab: (...place) => edit.grab(...place),
  click: (...place) => edit.click(...place),
  panned: () => options.follow !== null && options.set({follow: null}),
});
new Effects(scene, permit, ask, say);
new Plot(scene, picture);
new Frames(scene, ask);
new BodyPanel(scene, options, permit, ask, say, edits);

function chosen() {
  return options.selected === null ? null : scene.body(options.selected);
}

function follow() {
  const body = chosen() ?? scene.chair;
  options.set({follow: options.follow === null && body ? body.id : null});
  scene.tell("state", scene.state);
}

const tabs = setUpTabs();
const table = keyTable({picture, options, transport, bag, stick, edit, pointer, tabs, follow, chosen, edits});
listen(table);
setUpHelp(table.filter(({shown}) => shown).map(({shown, meaning}) => [shown, meaning]));
setUpTheme(() => picture.recolor());

const click = (id, action) => byId(id).addEventListener("click", action);
click("zoom-in", () => picture.camera.zoom(1.4) ?? picture.dirty());
click("zoom-out", () => picture.camera.zoom(1 / 1.4) ?? picture.dirty());
click("fit", () => picture.fit());
click("follow", follow);
click("more", () => byId("more").setAttribute("aria-expanded", String(document.body.classList.toggle("all"))));
click("clear", () => scene.forget());
click("screenshot", () => picture.flat().toBlob((blob) => {
  const t = scene.state ? `_${scene.state.t.toFixed(2)}s` : "";
  download(blob, `kurumaisu${t}.png`);
  say("The picture was saved.");
}));

click("save-world", async () => {
  const reply = await ask("save_world");
  if (!reply.ok) return;
  download(new Blob([reply.result], {type: "text/plain"}), "saved.world");
  say(`The world was saved as it is ${reply.message}.`);
});

permit.on("change", () => {
  // the panel of effects is the one to begin with where there are any
  if (tabs.current?.hidden) tabs.show("view");
});
const places = new Places(picture, scene, permit, options, bag);
// the same link a second time changes no address
addEventListener("click", ({target}) => target.closest?.("a")?.hash === location.hash && location.hash && places.go());
answer((fragment) => {
  if (!bag.playback) return "It shows no recording.";
  if (!permit.can("seek")) return permit.why;
  history.replaceState(null, "", fragment);
  places.go();
  return "";
});
addEventListener("hashchange", () => {
  const token = takeToken();
  if (token !== null) connection.useToken(token);
  places.go();
});

connection.on("message", (message) => scene.take(message));
connection.on("binary", (buffer) => scene.takeBinary(buffer));
connection.start();
