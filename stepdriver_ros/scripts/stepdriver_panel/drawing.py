"""The drawing of the page: read from an SVG file, planned by the driver, and drawn."""

import asyncio
import json
import math
import pathlib
import sys

from stepdriver.msg import PathSegment
from stepdriver.srv import FollowPath, PlanPath
from stepdriver_plots.drawing import segments

from .errors import Refusal
from .threads import in_thread
from .units import in_page_units

READER = pathlib.Path(__file__).resolve().parent / "read_drawing.py"
PATIENCE = 120.0  # [s] for the reader, on a busy computer
MM = 1000.0  # in a metre
HIGHEST_TOLERANCE = 10.0  # [mm]


def optional(query, key, least=-math.inf):
    """A number of a query; None if it is empty."""
    text = query.get(key, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise Refusal(f"{key} is {text!r}, but must be a number") from None
    if not math.isfinite(value) or value < least:
        raise Refusal(f"{key} is {text}, but must be a number{'' if least == -math.inf else f' from {least:g} on'}")
    return value


def pair(machine):
    """The two axes that draw: x and y, or the first two linear ones."""
    linear = [axis for axis in machine.axes.values() if axis.unit == "mm"]
    named = [axis for axis in linear if axis.name in ("x", "y")]
    chosen = sorted(named, key=lambda axis: axis.name) if len(named) == 2 else linear[:2]
    if len(chosen) < 2:
        raise Refusal("a drawing needs two linear axes")
    return chosen


class Drawing:
    """One for all pages. shown: what they are told of it; strokes are fetched by their version."""

    def __init__(self, machine):
        self._machine = machine
        self._version = 0
        self._axes, self._strokes = [], []
        self._speed, self._tolerance = 0.0, 0.0
        self._busy = False
        self.shown = {"version": 0, "state": "none", "problem": "", "facts": {}, "axes": []}

    def strokes(self):
        """[mm] of the newest version."""
        return {"version": self._version, "strokes": self._strokes,
                "limits": [list(axis.limits) for axis in self._axes]}

    def _show(self, state, problem="", **facts):
        self.shown = {"version": self._version, "state": state, "problem": problem, "facts": facts,
                      "axes": [axis.name for axis in self._axes]}

    async def read(self, document, query, publish):
        """Takes the place of the drawing before. publish: called after each change of `shown`."""
        if self._busy:
            raise Refusal("another drawing is being read or drawn")
        options = {"scale": optional(query, "scale", 1e-9), "corner": None}
        corner = [optional(query, "corner-x"), optional(query, "corner-y")]
        if corner != [None, None]:
            if None in corner:
                raise Refusal("the corner needs both x and y")
            options["corner"] = corner
        speed, tolerance = optional(query, "speed", 0.0) or 0.0, optional(query, "tolerance", 0.0) or 0.0
        if tolerance > HIGHEST_TOLERANCE:
            raise Refusal(f"tolerance is {tolerance:g} mm, but must be from 0 to {HIGHEST_TOLERANCE:g} mm")
        axes = pair(self._machine)
        options.update(axes=[axis.name for axis in axes], limits=[axis.limits for axis in axes])
        self._busy = True
        try:
            self._version += 1
            self._axes, self._strokes, self._speed, self._tolerance = axes, [], speed, tolerance
            self._show("reading")
            publish()
            answer = await run_reader(document, options)
            self._strokes = answer.get("strokes", [])
            await in_thread(self._plan, answer)
        finally:
            self._busy = False
            if self.shown["state"] == "reading":
                self._show("refused", "the drawing can't be read")
            publish()

    def _plan(self, answer):
        """Asks the driver for the time, if there is something to draw. It waits for the driver."""
        problem = in_page_units(answer["problem"])
        if not self._strokes:
            self._show("refused", problem or "the drawing contains no line")
            return
        lines = self._lines()
        xs, ys = zip(*(point for stroke in self._strokes for point in stroke))
        drawn, way = (sum(math.dist(begin, end) for begin, end, is_drawn in lines if is_drawn == wanted)
                      for wanted in (True, False))
        facts = {"width": max(xs) - min(xs), "height": max(ys) - min(ys), "left": min(xs), "low": min(ys),
                 "strokes": len(self._strokes), "lines": len(lines), "drawn": drawn, "way": way,
                 "corners": answer["corners"], "tolerance": self._tolerance, "time": None}
        if not problem:
            try:
                facts["time"] = self._machine.driver.call("plan_path", PlanPath, **self._path(lines)).duration
            except Refusal as refusal:
                problem = str(refusal)
        self._show("refused" if problem else "ready", problem, **facts)

    def _place(self):
        message = self._machine.driver.states.message
        return tuple(message.position[message.name.index(axis.name)] * axis.factor for axis in self._axes)

    def _lines(self):
        return list(segments(self._place(), self._strokes))

    def _path(self, lines):
        return {"name": [axis.name for axis in self._axes], "velocity": self._speed / MM,
                "tolerance": self._tolerance / MM,
                "segments": [PathSegment(shape=PathSegment.LINE, end=[value / MM for value in end])
                             for _, end, _ in lines]}

    def begin(self, version):
        """Called before draw(), in the server's thread. Raises Refusal."""
        if self._busy:
            raise Refusal("another drawing is being read or drawn")
        if self.shown["state"] not in ("ready", "drawn", "ended") or version != self._version:
            raise Refusal("there is no drawing that was previewed")
        self._busy = True
        self._show("drawing", **self.shown["facts"])

    def draw(self):
        """Returns at its end what the driver says. It waits for the driver. Raises Refusal."""
        state = "ended"
        try:
            lines = self._lines()
            if not lines:
                raise Refusal("the drawing is only the point at which the axes are")
            answer = self._machine.driver.call("follow_path", FollowPath, wait=True, **self._path(lines))
            state = "drawn"
            return in_page_units(answer.message)
        finally:
            self._busy = False
            self._show(state, **self.shown["facts"])


async def run_reader(document, options):
    """The reader's answer to a document."""
    reader = await asyncio.create_subprocess_exec(
        sys.executable, "-B", str(READER), json.dumps(options), stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL)
    try:
        output, _ = await asyncio.wait_for(reader.communicate(document), PATIENCE)
        return json.loads(output)
    except (asyncio.TimeoutError, ValueError):
        return {"problem": "the drawing takes more time or memory than the panel allows"}
    finally:
        if reader.returncode is None:
            reader.kill()
            await reader.wait()
