// Outputs and inputs with a name. A switch shows what the driver has said of its output, not what was asked for.

import { setText } from "./machine.js";

const byId = (id) => document.getElementById(id);

function ageText(seconds) {
  if (seconds < 60) return `${Math.max(0, Math.floor(seconds))} s`;
  return seconds < 3600 ? `${Math.floor(seconds / 60)} min` : `${Math.floor(seconds / 3600)} h`;
}

class Line {
  constructor(name, button) {
    this.root = document.createElement("li");
    this.root.dataset.name = name;
    const label = document.createElement("span");
    label.textContent = name;
    this.state = document.createElement("span");
    this.state.className = "io-state";
    this.root.append(label, this.state, ...(button ? [button] : []));
  }

  tell(words, state) {
    this.words = words;
    this.changed = state.changed;
    this.why = state.error || state.note || "";
    this.state.classList.toggle("bad", Boolean(state.error));
  }

  age(tick) {
    const since = this.changed === null ? "since the start" : `for ${ageText(tick - this.changed)}`;
    setText(this.state, `${this.words} ${since}${this.why ? `: ${this.why}` : ""}`);
  }
}

class Output extends Line {
  constructor(name, connection) {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("role", "switch");
    button.setAttribute("aria-label", `output ${name}`);
    super(name, button);
    this.button = button;
    button.addEventListener("click", () => connection.send("set_output", { output: name, on: !this.on }));
  }

  show(state) {
    this.on = state.on;
    this.button.setAttribute("aria-checked", String(state.on));
    setText(this.button, state.on ? "Switch off" : "Switch on");
    super.tell(state.words, state);
  }
}

class Input extends Line {
  show(state) {
    super.tell(state.active ? "active" : "inactive", state);
  }
}

export class IoCard {
  #connection;
  #lines = { outputs: new Map(), inputs: new Map() };

  constructor(connection) {
    this.#connection = connection;
  }

  show(io) {
    const makers = { outputs: (name) => new Output(name, this.#connection), inputs: (name) => new Input(name) };
    for (const [kind, make] of Object.entries(makers)) {
      const lines = this.#lines[kind];
      const names = io[kind].map((state) => state.name);
      if (names.join("\n") !== [...lines.keys()].join("\n")) {
        lines.clear();
        for (const name of names) lines.set(name, make(name));
        byId(kind).replaceChildren(...[...lines.values()].map((line) => line.root));
      }
      for (const state of io[kind]) lines.get(state.name).show(state);
    }
    byId("io").hidden = io.outputs.length + io.inputs.length === 0;
  }

  // The tick of an update, on the same clock as the times of changes.
  age(tick) {
    for (const lines of Object.values(this.#lines)) for (const line of lines.values()) line.age(tick);
  }
}
