// Joins the screens with the connection.

import { Connection } from "./connection.js";
import { DrawingScreen } from "./drawing.js";
import { IoCard } from "./io.js";
import { MachineScreen, setText } from "./machine.js";
import { PlotsScreen } from "./plots.js";

const STALE = 1; // [s]
const byId = (id) => document.getElementById(id);
const parts = {};

function say(good, text, answer = {}) {
  if (answer.jog) machine.held.end();
  const said = byId("said");
  said.className = good ? "" : "bad";
  said.textContent = text;
}

const connection = new Connection(update, say);
const machine = new MachineScreen(connection);
const io = new IoCard(connection);
const plots = new PlotsScreen(connection, say);
const screens = [new DrawingScreen(connection), plots];

function stop() {
  machine.held.end();
  connection.send("stop");
}

byId("stop").addEventListener("click", stop);
byId("emergency").addEventListener("click", () => {
  machine.held.end();
  connection.send("emergency_stop");
});
byId("take-control").addEventListener("click", () => connection.send("take_control"));
// Before any other use of these keys: buttons are pressed by Enter.
window.addEventListener("keydown", (event) => {
  if (event.key !== "Escape" && event.key !== " ") return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (!event.repeat) stop();
}, { capture: true });
window.addEventListener("keyup", (event) => {
  if (event.key === " ") event.preventDefault(); // which would press the button that has the focus
}, { capture: true });

function showConnection(update) {
  const badge = byId("connection");
  let text = "not connected";
  let live = false;
  if (update === null) {
    if (connection.isShutOut) text = "wrong token: open the link that the launch printed";
  } else if (update.age === null) {
    text = "no data of the driver yet";
  } else {
    live = update.age < STALE;
    text = live ? `live, ${update.age.toFixed(1)} s old` : `no data for ${update.age.toFixed(0)} s`;
  }
  setText(badge, text);
  badge.className = `badge ${live ? "good" : "bad"}`;
  document.body.classList.toggle("stale", !live);
  if (!live) machine.held.end();
}

function showControl() {
  const notice = byId("control");
  const { control } = parts;
  notice.hidden = !control || connection.number === null || control.controller === connection.number;
  if (!notice.hidden) {
    setText(byId("control-text"), control.controller === null
      ? "No page has control: this one only watches. Stop works."
      : "Another page has control: this one only watches. Stop works.");
  }
}

const SHOW = {
  settings: (value) => {
    setText(byId("driver"), value.driver);
    document.title = value.driver;
    machine.configure(value);
    plots.configure(value);
    if (parts.states) machine.showStates(parts.states);
    if (parts.chips) machine.showChips(parts.chips);
  },
  states: (value) => machine.showStates(value),
  io: (value) => io.show(value),
  chips: (value) => machine.showChips(value),
  override: (value) => machine.showOverride(value),
  events: (value) => machine.showEvents(value),
  control: () => {},
};

function update(values) {
  showConnection(values);
  if (values === null) return;
  for (const [name, show] of Object.entries(SHOW)) {
    if (name in values) {
      parts[name] = values[name];
      show(values[name]);
    }
  }
  showControl();
  machine.showPositions(values.positions);
  io.age(values.tick);
  for (const screen of screens) screen.update(values, parts);
}

const tabs = [...document.querySelectorAll('[role="tab"]')];
function choose(tab) {
  machine.held.end();
  for (const other of tabs) {
    const chosen = other === tab;
    other.setAttribute("aria-selected", String(chosen));
    other.tabIndex = chosen ? 0 : -1;
    byId(other.getAttribute("aria-controls")).hidden = !chosen;
  }
  for (const screen of screens) screen.shown(tab.getAttribute("aria-controls"));
}
tabs.forEach((tab, i) => {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs[(i + step + tabs.length) % tabs.length];
    next.focus();
    choose(next);
  });
});
choose(tabs[0]);
