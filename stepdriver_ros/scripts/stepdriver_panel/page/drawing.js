// The second screen: an SVG file becomes a drawing of the machine. The server reads the file; this page only
// sees lines.

import { colour, prepared } from "./canvas.js";

const MARGIN = 24; // [px]
const FIELDS = ["tolerance", "speed", "scale", "corner-x", "corner-y"];
const LARGEST = 4 << 20; // [bytes], as the server allows
const MOST_WAY = 200000; // points
const byId = (id) => document.getElementById(id);

function duration(seconds) {
  const whole = Math.round(seconds);
  return whole < 60 ? `${seconds.toFixed(1)} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

export class DrawingScreen {
  #connection;
  #shown = { version: 0, state: "none", facts: {} };
  #strokes = [];
  #limits = [];
  #version = 0; // which strokes are drawn
  #way = [];
  #begin = null;
  #visible = false;

  constructor(connection) {
    this.#connection = connection;
    byId("preview").addEventListener("click", () => this.#read());
    byId("draw").addEventListener("click", () => {
      this.#way = [];
      connection.send("draw", { version: this.#shown.version }, () => this.#paint());
    });
    for (const field of [...FIELDS, "svg"]) {
      byId(field).addEventListener("input", () => {
        byId("draw").disabled = true; // what is drawn is what was previewed
      });
    }
    byId("svg").addEventListener("change", () => this.#read());
    window.addEventListener("resize", () => this.#paint());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#paint());
  }

  shown(name) {
    this.#visible = name === "drawing";
    this.#paint();
  }

  async #read() {
    const [file] = byId("svg").files;
    const text = byId("drawing-text");
    if (!file) {
      text.textContent = "Choose an SVG file first.";
      return;
    }
    if (!this.#connection.isOpen) {
      text.textContent = "Nothing was sent, because there is no connection.";
      return;
    }
    if (file.size > LARGEST) {
      text.textContent = `${file.name} has ${file.size} bytes; at most ${LARGEST} are allowed.`;
      return;
    }
    const query = new URLSearchParams(FIELDS.map((field) => [field, byId(field).value]));
    try {
      const answer = await fetch(`drawing?${query}`, { method: "POST", headers: this.#connection.headers, body: file });
      const { problem } = answer.ok ? await answer.json() : { problem: await answer.text() };
      if (problem) text.textContent = problem;
    } catch {
      text.textContent = "The connection was lost while the file was sent.";
    }
  }

  update(values, parts) {
    if (values.drawing) this.#show(values.drawing);
    if (!values.way || this.#shown.state !== "drawing") return;
    this.#way.push(...values.way);
    if (this.#way.length > MOST_WAY) this.#way.splice(0, this.#way.length - MOST_WAY);
    this.#paint();
    this.#showProgress();
  }

  #show(shown) {
    const before = this.#shown;
    this.#shown = shown;
    if (shown.state === "drawing" && before.state !== "drawing") this.#begin = performance.now();
    byId("draw").disabled = !["ready", "drawn", "ended"].includes(shown.state);
    byId("draw").textContent = shown.state === "drawn" || shown.state === "ended" ? "Draw again" : "Draw";
    byId("drawing-text").className = shown.problem ? "bad" : "";
    byId("drawing-text").textContent = {
      none: "",
      reading: "The file is being read …",
      refused: `Refused: ${shown.problem}`,
      ready: "Ready. The axes move when you press Draw.",
      drawing: "Drawing …",
      drawn: "Drawn.",
      ended: "It ended before its end.",
    }[shown.state];
    this.#showFacts();
    if (shown.version !== this.#version && shown.facts.lines) this.#fetch();
    this.#paint();
  }

  #showFacts() {
    const { facts } = this.#shown;
    const rows = facts.lines === undefined ? [] : [
      ["size", `${facts.width.toFixed(2)} × ${facts.height.toFixed(2)} mm, from (${facts.left.toFixed(2)}, ${facts.low.toFixed(2)})`],
      ["strokes, lines", `${facts.strokes}, ${facts.lines}`],
      ["length", `${facts.drawn.toFixed(1)} mm drawn, ${facts.way.toFixed(1)} mm between strokes`],
      ["time", facts.time === null ? "not known" : duration(facts.time)],
      ["corners", facts.tolerance > 0 ? `${facts.corners} rounded by up to ${facts.tolerance} mm` : `${facts.corners}, a stop at each line's end`],
    ];
    byId("drawing-facts").replaceChildren(...rows.flatMap(([name, value]) => {
      const term = document.createElement("dt");
      const text = document.createElement("dd");
      term.textContent = name;
      text.textContent = value;
      return [term, text];
    }));
  }

  #showProgress() {
    const time = this.#shown.facts.time;
    if (!time || this.#begin === null) return;
    const passed = (performance.now() - this.#begin) / 1000;
    byId("drawing-text").textContent = `Drawing: ${duration(passed)} of about ${duration(time)}.`;
  }

  async #fetch() {
    try {
      const answer = await fetch("drawing", { headers: this.#connection.headers });
      const drawing = await answer.json();
      this.#version = drawing.version;
      this.#strokes = drawing.strokes;
      this.#limits = drawing.limits;
      if (this.#shown.state !== "drawing") this.#way = [];
    } catch {
      return; // the next change brings it
    }
    this.#paint();
  }

  #paint() {
    if (!this.#visible) return;
    const canvas = byId("canvas");
    const points = this.#strokes.flat();
    // The limits, and what is beyond them.
    const [x, y] = [0, 1].map((side) => {
      const values = points.map((point) => point[side]);
      values.push(...(this.#limits[side] ?? []).filter((limit) => limit !== null));
      const low = values.reduce((least, value) => Math.min(least, value), values[0] ?? 0);
      const high = values.reduce((most, value) => Math.max(most, value), low + 1e-6);
      return { low, high };
    });
    const there = prepared(canvas, Math.min(1.2, Math.max(0.5, (y.high - y.low) / (x.high - x.low))));
    if (!there) return;
    const { context, width, height } = there;
    const scale = Math.min((width - 2 * MARGIN) / (x.high - x.low), (height - 2 * MARGIN) / (y.high - y.low));
    const at = ([px, py]) => [MARGIN + (px - x.low) * scale, height - MARGIN - (py - y.low) * scale];
    this.#paintLimits(context, at);
    if (this.#strokes.length === 0) return;
    this.#paintTravel(context, at);
    context.strokeStyle = colour("line");
    context.lineWidth = 1.5;
    for (const stroke of this.#strokes) line(context, stroke.map(at));
    context.strokeStyle = colour("pen");
    context.lineWidth = 2;
    line(context, this.#way.map(at));
  }

  #paintLimits(context, at) {
    if (this.#limits.length === 0 || this.#limits.flat().includes(null)) return;
    const [x, y] = this.#limits.map(([low, high]) => ({ low, high }));
    context.strokeStyle = colour("text");
    context.fillStyle = colour("quiet");
    context.lineWidth = 1;
    context.setLineDash([5, 4]);
    line(context, [[x.low, y.low], [x.high, y.low], [x.high, y.high], [x.low, y.high], [x.low, y.low]].map(at));
    context.setLineDash([]);
    const [left, low] = at([x.low, y.low]);
    const [right, high] = at([x.high, y.high]);
    context.fillText(`${x.low}, ${y.low} mm`, left, low + 15);
    context.textAlign = "right";
    context.fillText(`${x.high}, ${y.high} mm`, right, high - 6);
    context.textAlign = "left";
  }

  #paintTravel(context, at) {
    context.strokeStyle = colour("way");
    context.lineWidth = 1;
    context.setLineDash([2, 3]);
    for (let i = 1; i < this.#strokes.length; i += 1) {
      line(context, [this.#strokes[i - 1].at(-1), this.#strokes[i][0]].map(at));
    }
    context.setLineDash([]);
  }
}

function line(context, points) {
  if (points.length === 0) return;
  context.beginPath();
  context.moveTo(...points[0]);
  for (const point of points.slice(1)) context.lineTo(...point);
  if (points.length === 1) context.arc(...points[0], 1, 0, 7);
  context.stroke();
}
