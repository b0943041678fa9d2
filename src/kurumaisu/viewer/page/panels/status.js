// SPDX-License-Identifier: BSD-3-Clause
// Readings, the state of the line, notes of the source, and messages to the user.

import {byId, fixed, make, setText} from "../common/dom.js";

const STALE = 2000; // [ms] without news: said
const LOOK = 500; // [ms] between looks at that
const TOAST = 6000; // [ms] that a message stays
const LOG = 100; // messages that are kept
const READ = 100; // [ms] between changes of figures: faster nobody reads
const MODES = {sim: "simulator", robot: "robot", bag: "recording"};

export class Status {
  #heard = 0;
  #read = 0;
  #line = {state: "off"};
  #notes = "";
  #timers = {};

  constructor(scene, permit, connection) {
    Object.assign(this, {scene, permit});
    scene.on("hello", () => this.#greet());
    scene.on("state", (state) => state && this.#show(state));
    scene.on("hello world state", () => (this.#heard = performance.now()));
    permit.on("change", () => this.#explain());
    connection.on("line", (line) => {
      this.#line = line;
      this.#heard = performance.now();
      this.#tellLine();
    });
    connection.on("refused", (why) => why && this.say(why, true));
    byId("banner-copy").addEventListener("click", () => this.#copy());
    setInterval(() => this.#tellLine(), LOOK);
  }

  /** Tell the user, and keep it among the messages. */
  say(text, bad = false) {
    const toast = byId(bad ? "alarm" : "toast");
    toast.textContent = text;
    clearTimeout(this.#timers[toast.id]);
    this.#timers[toast.id] = setTimeout(() => (toast.textContent = ""), TOAST);
    const time = make("time", {textContent: new Date().toTimeString().slice(0, 8)});
    byId("log").prepend(make("li", {data: {level: bad ? "error" : "info"}}, time, " ", text));
    byId("log").children[LOG]?.remove();
  }

  #greet() {
    const {title, mode, report} = this.scene.hello;
    setText(byId("title"), title);
    document.title = `${title} - kurumaisu`;
    setText(byId("mode"), MODES[mode] ?? mode);
    byId("mode").hidden = false;
    const link = byId("report");
    link.hidden = !report;
    if (report) link.href = new URL(report, document.baseURI).pathname; // of this server, whatever it says
  }

  async #copy() {
    const place = byId("banner-command");
    getSelection().selectAllChildren(place); // for who may not write to the clipboard, to copy by hand
    try {
      await navigator.clipboard.writeText(place.textContent);
      this.say("The command was copied.");
    } catch {
      this.say("The command is selected: copy it with Ctrl-C.");
    }
  }

  #tellLine() {
    const {state, seconds, why} = this.#line;
    const silent = performance.now() - this.#heard;
    let [text, mark] = ["Connected", "on"];
    if (state === "wrong") [text, mark] = ["Page and server have different versions: reload the page", "off"];
    else if (state !== "on") [text, mark] = [seconds ? `${why || "No connection"}: retrying` : "Connecting", "off"];
    else if (silent > STALE && this.#expected()) [text, mark] = [`No new data for more than ${STALE / 1000} s`, "stale"];
    const place = byId("connection");
    setText(place, text);
    place.dataset.state = mark;
    document.body.classList.toggle("stale", mark !== "on");
  }

  /** A source that stands still has nothing to say. */
  #expected() {
    const {paused, playback} = this.scene.state ?? {};
    return !paused && (playback?.playing ?? true);
  }

  #explain() {
    const {notice, command} = this.permit;
    byId("banner").hidden = !notice;
    setText(byId("banner-text"), notice);
    setText(byId("banner-command"), command);
    byId("banner-copy").hidden = !command;
  }

  #show(state) {
    this.#showNotes(state.notes ?? []);
    if (performance.now() - this.#read < READ && !state.paused) return;
    this.#read = performance.now();
    for (const [id, value] of Object.entries({vw: state.v, commanded: state.commanded, volts: state.volts, driver: state.driver})) {
      if (value != null) byId(`read-${id}`).parentElement.hidden = false; // it comes once there is such a thing here
    }
    const pair = (values, digits, units) => values?.map((value, i) => fixed(value, digits, units[i])).join(", ") ?? "–";
    const speed = ["m/s", "rad/s"];
    setText(byId("read-t"), fixed(state.t, 2, "s"));
    setText(byId("read-rtf"), fixed(state.rtf, 2, "×"));
    setText(byId("read-vw"), pair(state.v == null ? null : [state.v, state.w], 2, speed));
    setText(byId("read-commanded"), pair(state.commanded, 2, speed));
    setText(byId("read-volts"), pair(state.volts, 3, ["V", "V"]));
    setText(byId("read-driver"), state.driver || "–");
  }

  #showNotes(notes) {
    const key = JSON.stringify(notes);
    if (key === this.#notes) return;
    this.#notes = key;
    const items = notes.map(({level, text}) =>
      make("li", {data: {level}}, make("strong", {textContent: level}), " ", text));
    byId("notes").replaceChildren(...(items.length ? items : [make("li", {textContent: "nothing to report"})]));
    const count = byId("notes-count");
    count.hidden = !notes.length;
    setText(count, String(notes.length));
  }
}
