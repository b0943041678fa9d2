// SPDX-License-Identifier: BSD-3-Clause
// The frame: tabs, theme, help.

import {byId, make, setText} from "../common/dom.js";

const THEMES = ["auto", "light", "dark"];
const STORE = "kurumaisu.theme";
const NARROW = matchMedia("(max-width: 900px)");

/** Set up the tabs; a narrow page begins with the picture, and shows one when it is asked for. */
export function setUpTabs() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  const usable = () => tabs.filter((tab) => !tab.hidden);
  const show = (tab) => {
    for (const one of tabs) {
      one.setAttribute("aria-selected", String(one === tab));
      one.tabIndex = one === (tab ?? usable()[0]) ? 0 : -1;
      byId(one.getAttribute("aria-controls")).hidden = one !== tab;
    }
    byId("side").classList.toggle("shut", !tab);
  };
  for (const tab of tabs) {
    tab.addEventListener("click", () => show(NARROW.matches && tab.getAttribute("aria-selected") === "true" ? null : tab));
    tab.addEventListener("keydown", (event) => {
      const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      const list = usable();
      const next = list[(list.indexOf(tab) + step + list.length) % list.length];
      show(next);
      next.focus();
    });
  }
  byId("close").addEventListener("click", () => {
    show(null);
    byId("front").focus();
  });
  show(NARROW.matches ? null : byId("tab-view"));
  return {
    show: (name) => byId(`tab-${name}`).hidden || show(byId(`tab-${name}`)),
    get current() {
      return tabs.find((tab) => tab.getAttribute("aria-selected") === "true") ?? null;
    },
  };
}

/** Set up the switch of colours; changed() when others are on. */
export function setUpTheme(changed) {
  let theme = THEMES.find((name) => name === localStorage.getItem(STORE)) ?? THEMES[0];
  const button = byId("theme");
  const apply = () => {
    document.documentElement.dataset.theme = theme;
    setText(button, {auto: "Auto", light: "Light", dark: "Dark"}[theme]);
    button.setAttribute("aria-label", `Colours: ${theme}`);
    changed();
  };
  button.addEventListener("click", () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    localStorage.setItem(STORE, theme);
    apply();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
  apply();
}

/** keys: [[what is pressed, what it does], ...] */
export function setUpHelp(keys) {
  byId("help-keys").replaceChildren(...keys.map(([key, meaning]) =>
    make("div", {}, make("dt", {}, make("kbd", {textContent: key})), make("dd", {textContent: meaning}))));
  byId("help").addEventListener("click", () => byId("help-dialog").showModal());
}
