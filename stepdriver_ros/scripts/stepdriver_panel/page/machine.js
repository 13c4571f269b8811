// The first screen: the axes and what moves them.

import { HeldButton } from "./jog.js";

const STEPS = [-10, -1, -0.1, 0.1, 1, 10]; // [mm|deg]
const byId = (id) => document.getElementById(id);

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function chipText(chip) {
  if (!chip.setUp) return "not set up yet";
  const said = [`${chip.present.toFixed(2)} A (${chip.run.toFixed(2)} A moving, ${chip.hold.toFixed(2)} A at rest)`];
  if (chip.load !== null) said.push(`load of the last motion ${Math.round(100 * chip.load)} %`);
  if (chip.celsius > 0) said.push(`above ${chip.celsius} °C${chip.hot ? ": it will soon switch itself off" : ""}`);
  return said.join(", ");
}

class AxisCard {
  constructor(settings, connection, held, jogShare) {
    this.settings = settings;
    this.root = byId("axis").content.firstElementChild.cloneNode(true);
    this.root.dataset.axis = settings.name;
    const { name, unit } = settings;
    const field = (key) => this.root.querySelector(`[data-field="${key}"]`);
    this.fields = Object.fromEntries([...this.root.querySelectorAll("[data-field]")].map((one) => [one.dataset.field, one]));
    setText(field("name"), name);
    setText(field("unit"), unit);
    setText(field("goto-label"), `Go to [${unit}]`);
    this.root.setAttribute("aria-label", `axis ${name}`);
    this.#addLimits();
    for (const button of this.root.querySelectorAll(".jog")) {
      const direction = Number(button.dataset.direction);
      setText(button, direction < 0 ? `◀ hold: ${name} −` : `hold: ${name} + ▶`);
      button.setAttribute("aria-label", `jog ${name} towards ${direction < 0 ? "minus" : "plus"} while held`);
      held.watch(button, name, () => direction * jogShare() * settings.maxSpeed);
    }
    const steps = this.root.querySelector(".steps");
    for (const step of STEPS) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.by = step;
      setText(button, `${step < 0 ? "−" : "+"}${Math.abs(step)}`);
      button.setAttribute("aria-label", `move ${name} by ${step} ${unit}`);
      button.addEventListener("click", () => connection.send("move", { axis: name, by: step }));
      steps.append(button);
    }
    const form = this.root.querySelector(".goto");
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const input = form.querySelector("input");
      if (input.value !== "" && connection.send("move", { axis: name, to: Number(input.value) })) input.value = "";
    });
    this.#addButtons(connection);
    this.#addCurrents(connection);
  }

  #addLimits() {
    const { min, max, unit } = this.settings;
    const meter = this.fields.meter;
    meter.hidden = min === null || max === null;
    if (!meter.hidden) {
      meter.min = min;
      meter.max = max;
      meter.setAttribute("aria-label", "position between the limits");
    }
    setText(this.fields.low, min === null ? "no lower limit" : `${min} ${unit}`);
    setText(this.fields.high, max === null ? "no upper limit" : `${max} ${unit}`);
  }

  #addButtons(connection) {
    const { name } = this.settings;
    const sure = this.root.querySelector(".sure");
    setText(this.fields.sure, `Call the present position of ${name} 0?`);
    const button = (what) => this.root.querySelector(`[data-do="${what}"]`);
    const ask = (asked) => {
      sure.hidden = !asked;
      button(asked ? "zero-no" : "zero").focus();
    };
    button("home").hidden = !this.settings.homing;
    for (const [what, act] of Object.entries({
      enable: () => connection.send("enable", { axis: name, on: true }),
      disable: () => connection.send("enable", { axis: name, on: false }),
      home: () => connection.send("home", { axis: name }),
      zero: () => ask(true),
      "zero-no": () => ask(false),
      "zero-yes": () => {
        ask(false);
        connection.send("set_zero", { axis: name });
      },
    })) {
      button(what).addEventListener("click", act);
      button(what).setAttribute("aria-label", `${button(what).textContent}: ${name}`);
    }
  }

  #addCurrents(connection) {
    const { name, chips } = this.settings;
    for (const part of this.root.querySelectorAll(".chips")) part.hidden = !chips;
    const form = this.root.querySelector(".currents");
    for (const input of form.querySelectorAll("input")) {
      input.setAttribute("aria-label", `current of ${name} ${input.name === "run" ? "moving" : "at rest"}, in ampere`);
    }
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const [run, hold] = form.querySelectorAll("input");
      connection.send("set_current", { axis: name, run: Number(run.value), hold: Number(hold.value) });
    });
  }

  // What the driver chips on a UART say, one for each motor.
  showChips(chips) {
    const list = this.fields.chips;
    if (list.children.length !== 2 * chips.length) {
      list.replaceChildren(...chips.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
    }
    chips.forEach((chip, i) => {
      setText(list.children[2 * i], chip.motor ? `current of ${chip.motor}` : "current");
      setText(list.children[2 * i + 1], chipText(chip));
      list.children[2 * i + 1].className = chip.hot || !chip.setUp ? "warn" : "";
    });
  }

  show(state) {
    setText(this.fields.state, state.state);
    this.fields.state.className = `badge ${state.fault ? "bad" : state.held || !state.valid ? "warn" : "good"}`;
    setText(this.fields.motor, state.motor);
    setText(this.fields.validity, state.valid ? (state.homed ? "valid, homed" : "valid, not homed") : `not valid: ${state.note || (this.settings.homing ? "home it, or set zero" : "set zero")}`);
    this.fields.stopped.hidden = !state.stoppedBy;
    setText(this.fields.stopped, state.stoppedBy);
    for (const end of ["min", "max"]) {
      const there = this.settings.switches[end];
      setText(this.fields[end], !there ? "none" : (state[end]?.text ?? "not known"));
      this.fields[end].className = state[end]?.active ? "warn" : "";
    }
  }

  move([position, velocity]) {
    const { unit } = this.settings;
    const shown = Math.abs(position) < 0.5e-4 ? 0 : position;
    setText(this.fields.position, shown.toFixed(Math.abs(shown) < 10000 ? 4 : 2));
    setText(this.fields.velocity, `${velocity.toFixed(2)} ${unit}/s`);
    if (!this.fields.meter.hidden) this.fields.meter.value = position;
  }
}

export class MachineScreen {
  #cards = new Map();
  #names = [];
  #share = 0.05;
  #held;
  #connection;

  constructor(connection) {
    this.#connection = connection;
    this.#held = new HeldButton(connection);
    const press = (id, what, fields) => byId(id).addEventListener("click", () => connection.send(what, fields));
    press("enable-all", "enable", { on: true });
    press("disable-all", "enable", { on: false });
    press("home-all", "home", {});
    press("hold", "hold", {});
    press("resume", "resume", {});
    press("recover", "recover", {});
    const override = byId("override");
    override.addEventListener("input", () => setText(byId("override-text"), `${override.value} %`));
    override.addEventListener("change", () => connection.send("speed_override", { factor: override.value / 100 }));
    for (const button of document.querySelectorAll(".choice")) {
      button.addEventListener("click", () => {
        this.#share = Number(button.dataset.share);
        for (const other of document.querySelectorAll(".choice")) other.setAttribute("aria-pressed", String(other === button));
      });
    }
  }

  get held() {
    return this.#held;
  }

  configure(settings) {
    this.#held.end();
    this.#names = settings.axes.map((axis) => axis.name);
    this.#cards = new Map(settings.axes.map((axis) => [axis.name, new AxisCard(axis, this.#connection, this.#held, () => this.#share)]));
    byId("axes").replaceChildren(...[...this.#cards.values()].map((card) => card.root));
    byId("no-axes").hidden = settings.axes.length > 0;
    byId("home-all").hidden = !settings.axes.some((axis) => axis.homing);
  }

  showStates(states) {
    for (const state of states) this.#cards.get(state.name)?.show(state);
    const faulty = states.filter((state) => state.fault);
    const shown = faulty.map((state) => `${state.name}|${state.fault}|${state.remedy}`).join("\n");
    const faults = byId("faults");
    if (faults.dataset.shown === shown) return;
    faults.dataset.shown = shown;
    faults.replaceChildren(...faulty.map((state) => {
      const box = document.createElement("p");
      box.className = "fault";
      const name = document.createElement("b");
      name.textContent = `${state.name}: ${state.fault}`;
      box.append(name, state.remedy ? `. ${state.remedy}` : "");
      return box;
    }));
  }

  showChips(chips) {
    for (const [name, list] of Object.entries(chips)) this.#cards.get(name)?.showChips(list);
  }

  showPositions(positions) {
    positions.forEach((position, i) => {
      if (position) this.#cards.get(this.#names[i])?.move(position);
    });
  }

  showOverride(factor) {
    const override = byId("override");
    if (factor === null || document.activeElement === override) return;
    override.value = Math.round(factor * 100);
    setText(byId("override-text"), `${Math.round(factor * 100)} %`);
  }

  showEvents(events) {
    byId("no-events").hidden = events.length > 0;
    byId("events").replaceChildren(...[...events].reverse().map((event) => {
      const item = document.createElement("li");
      const time = document.createElement("time");
      const when = new Date(event.time * 1000);
      time.dateTime = when.toISOString();
      time.textContent = when.toLocaleTimeString();
      const level = document.createElement("b");
      level.textContent = `${event.level}: `;
      level.className = event.level === "error" ? "bad" : "warn";
      item.append(time, level, event.text);
      return item;
    }));
  }
}
