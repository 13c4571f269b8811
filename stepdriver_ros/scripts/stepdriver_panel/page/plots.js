// The third screen: the last minute, and the files of the flight recorder.

import { colour, prepared } from "./canvas.js";

const SPAN = 60; // [s]
const KEPT = 25 * SPAN; // updates
const RATIO = 0.28;
const PERIOD = 200; // [ms] between two pictures
const byId = (id) => document.getElementById(id);

// The values of the last minute, in a ring.
class Ring {
  constructor(columns) {
    this.columns = columns;
    this.values = new Float64Array(KEPT * (columns + 1));
    this.next = 0;
    this.count = 0;
  }

  push(time, values) {
    const begin = this.next * (this.columns + 1);
    this.values[begin] = time;
    values.forEach((value, i) => {
      this.values[begin + 1 + i] = value;
    });
    this.next = (this.next + 1) % KEPT;
    this.count = Math.min(this.count + 1, KEPT);
  }

  // The times and values of a column since a time.
  since(time, column) {
    const points = [];
    for (let i = 0; i < this.count; i += 1) {
      const at = ((this.next - this.count + i + KEPT) % KEPT) * (this.columns + 1);
      if (this.values[at] >= time && !Number.isNaN(this.values[at + 1 + column])) points.push([this.values[at], this.values[at + 1 + column]]);
    }
    return points;
  }
}

class Curve {
  constructor(title, unit, ring, column) {
    Object.assign(this, { title, unit, ring, column });
    this.root = document.createElement("div");
    this.root.className = "card";
    const heading = document.createElement("h2");
    heading.textContent = `${title} [${unit}]`;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", title);
    this.text = document.createElement("p");
    this.text.className = "quiet";
    this.root.append(heading, this.canvas, this.text);
  }

  paint(now) {
    const there = prepared(this.canvas, RATIO);
    if (!there) return;
    const { context, width, height } = there;
    const points = this.ring.since(now - SPAN, this.column);
    const values = points.map((point) => point[1]);
    let low = values.reduce((least, value) => Math.min(least, value), 0);
    let high = values.reduce((most, value) => Math.max(most, value), 0);
    const shown = values.length ? `now ${values.at(-1).toFixed(2)}, from ${Math.min(...values).toFixed(2)} to ${Math.max(...values).toFixed(2)} ${this.unit} in the last minute` : "no data";
    if (this.text.textContent !== shown) this.text.textContent = shown;
    this.canvas.setAttribute("aria-label", `${this.title}: ${shown}`);
    if (high === low) high = low + 1;
    const margin = 0.06 * (high - low);
    low -= margin;
    high += margin;
    const at = (value) => height - ((value - low) / (high - low)) * height;
    context.strokeStyle = colour("edge");
    context.fillStyle = colour("quiet");
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(0, at(0));
    context.lineTo(width, at(0));
    context.stroke();
    context.fillText((high - margin).toPrecision(4), 4, 13);
    context.fillText((low + margin).toPrecision(4), 4, height - 4);
    context.strokeStyle = colour("line");
    context.lineWidth = 1.5;
    context.beginPath();
    points.forEach(([time, value], i) => {
      const x = width - ((now - time) / SPAN) * width;
      if (i === 0) context.moveTo(x, at(value));
      else context.lineTo(x, at(value));
    });
    context.stroke();
  }
}

export class PlotsScreen {
  #connection;
  #say;
  #ring = null;
  #curves = [];
  #visible = false;
  #painted = 0;

  constructor(connection, say) {
    this.#connection = connection;
    this.#say = say;
    byId("list").addEventListener("click", () => this.#list());
    byId("dump").addEventListener("click", () => connection.send("dump", {}, () => this.#list()));
  }

  configure(settings) {
    const axes = settings.axes;
    this.#ring = new Ring(2 * axes.length + 1);
    this.#curves = axes.flatMap((axis, i) => [
      new Curve(`${axis.name}: position`, axis.unit, this.#ring, 2 * i),
      new Curve(`${axis.name}: velocity`, `${axis.unit}/s`, this.#ring, 2 * i + 1),
    ]);
    this.#curves.push(new Curve("latest pulse of each second: lateness", "µs", this.#ring, 2 * axes.length));
    byId("curves").replaceChildren(...this.#curves.map((curve) => curve.root));
  }

  shown(name) {
    const before = this.#visible;
    this.#visible = name === "plots";
    if (this.#visible && !before) this.#list();
  }

  update(values) {
    if (this.#ring === null) return;
    const columns = values.positions.flatMap((position) => position ?? [NaN, NaN]);
    if (columns.length !== this.#ring.columns - 1) return;
    this.#ring.push(values.tick, [...columns, values.late ?? NaN]);
    const now = performance.now();
    if (!this.#visible || now - this.#painted < PERIOD) return;
    this.#painted = now;
    for (const curve of this.#curves) curve.paint(values.tick);
  }

  async #list() {
    if (!this.#connection.isOpen) return;
    try {
      const answer = await fetch("recordings", { headers: this.#connection.headers });
      const { recordings, problem } = await answer.json();
      byId("recordings-text").textContent = problem || (recordings.length ? "" : "There are no recordings on the panel's computer.");
      byId("recordings").replaceChildren(...recordings.map((recording) => this.#row(recording)));
    } catch {
      byId("recordings-text").textContent = "The list can't be read: the connection was lost.";
    }
  }

  #row({ name, size }) {
    const row = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Save";
    button.setAttribute("aria-label", `Save ${name}`);
    button.addEventListener("click", () => this.#save(name));
    row.append(`${name} (${size < 10000 ? `${size} bytes` : `${(size / 1e6).toFixed(2)} MB`})`, button);
    return row;
  }

  // With the token in a header, a link wouldn't do.
  async #save(name) {
    try {
      const answer = await fetch(`recordings/${name}`, { headers: this.#connection.headers });
      if (!answer.ok) throw new Error(await answer.text());
      const address = URL.createObjectURL(await answer.blob());
      const link = document.createElement("a");
      link.href = address;
      link.download = name;
      link.click();
      setTimeout(() => URL.revokeObjectURL(address), 60000);
    } catch (error) {
      this.#say(false, `${name} can't be read: ${error.message}`);
    }
  }
}
