#!/usr/bin/python3
"""Draws the pictures of docs/motion.md from recorded traces; motion_pictures.sh calls it."""

import bisect
import cmath
import csv
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "stepdriver_ros/scripts"))
from stepdriver_plots import figure as look  # noqa: E402: the path comes first
from stepdriver_plots.figure import COLOURS, MultipleLocator, plt  # noqa: E402
from stepdriver_plots.step_curve import StepCurve  # noqa: E402

UNITS = {"position": "steps", "speed": "steps/s", "acceleration": "steps/s$^2$"}
STEPS_PER_MM = 80  # of the traces with outputs or flags


class Trace:
    def __init__(self, folder, name):
        self.marks = []
        self.steps = {}  # for each axis: times [s] and counts
        self.curves = {}  # by name: times [s] and values
        self.levels = {}  # of outputs and flags, by name: times [s] and levels
        with open(folder / (name + ".csv"), newline="") as file:
            for kind, axis, time_ns, what in csv.reader(file):
                time = int(time_ns) * 1e-9
                if kind == "mark":
                    self.marks.append((time, what))
                elif kind == "curve":
                    times, values = self.curves.setdefault(axis, ([], []))
                    times.append(time)
                    values.append(int(what) / 1000)
                elif kind == "level":
                    times, levels = self.levels.setdefault(axis, ([], []))
                    times.append(time)
                    levels.append(int(what))
                else:
                    times, counts = self.steps.setdefault(axis, ([], []))
                    times.append(time)
                    counts.append(int(what))

    def curve(self, axis):
        return StepCurve.of_counts(*self.steps[axis])

    def end(self):
        return max(times[-1] for times, _ in self.steps.values())

    def places(self, axis, start=0.0):
        """Times [s] and positions [mm] from the begin to the end."""
        times, counts = self.steps[axis]
        return ([0.0] + times + [self.end()],
                [start + count / STEPS_PER_MM for count in [0] + counts + counts[-1:]])

    def place_at(self, axis, time):
        """[mm]"""
        times, places = self.places(axis)
        return places[bisect.bisect_right(times, time) - 1]

    def switched(self, name, on):
        """Times [s]."""
        return [time for time, level in zip(*self.levels[name]) if level == on and time > 0.0]


def draw(folder, picture, curves, what, width=6.4, phases=(), levels=()):
    """curves: (trace, axis, label) for each; what: the quantities, each of which gets a panel;
    phases: (begin [s], end [s], name) for each; levels: (speed [steps/s], name) for each."""
    figure, panels = plt.subplots(len(what), 1, sharex=True, squeeze=False,
                                  figsize=(width, 0.5 + 1.35 * len(what)))
    for quantity, panel in zip(what, panels[:, 0]):
        for colour, (trace, axis, label) in zip(COLOURS, curves):
            times, values = getattr(trace.curve(axis), quantity)()
            panel.plot(times, values, color=colour, label=label)
        for time, words in curves[0][0].marks:
            panel.axvline(time, color="#888888", linewidth=0.8, linestyle=":")
            if panel is panels[0, 0]:
                panel.annotate(words, (time, 1.0), xycoords=("data", "axes fraction"),
                               xytext=(2, 1), textcoords="offset points", color="#555555")
        for begin, end, name in phases:
            panel.axvline(end, color="#888888", linewidth=0.8, linestyle=":")
            if panel is panels[0, 0]:
                panel.annotate(name, ((begin + end) / 2, 1.0), xycoords=("data", "axes fraction"),
                               xytext=(0, 2), textcoords="offset points", ha="center",
                               color="#555555")
        for speed, name in levels if quantity == "speed" else ():
            panel.axhline(speed, color="#888888", linewidth=0.8, linestyle="--")
            panel.annotate(name, (0.62, speed), xycoords=("axes fraction", "data"),
                           xytext=(0, 2), textcoords="offset points", ha="center", color="#555555")
        if quantity == "speed" and min(panel.dataLim.intervaly) >= 0.0:
            panel.set_ylim(bottom=0.0)
        panel.set_ylabel(f"{quantity}\n[{UNITS[quantity]}]")
    if len(curves) > 1:
        panels[0, 0].legend(loc="best", frameon=False)
    panels[-1, 0].set_xlabel("time [s]")
    save(figure, folder, picture)


def draw_half_steps(folder, trace):
    """The edges, and the curve that they follow: 8 steps at 2000 steps/s^2."""
    figure, panel = plt.subplots(figsize=(6.4, 2.4))
    times, counts = trace.steps["x"]
    begin = times[0] - (2 * 0.5 / 2000) ** 0.5
    half = (8 / 2000) ** 0.5
    ticks = [2 * half * i / 400 for i in range(401)]
    curve = [1000 * t * t if t < half else 8 - 1000 * (2 * half - t) ** 2 for t in ticks]
    for count in counts:
        panel.axhline(count - 0.5, color="#bbbbbb", linewidth=0.6, linestyle=":")
    panel.plot(ticks, curve, color=COLOURS[1], label="the curve")
    at = [0.0] + [time - begin for time in times] + [2 * half]
    panel.step(at, [0] + counts + [8], where="post", color=COLOURS[0], label="count of the edges")
    panel.plot(at[1:-1], [count - 0.5 for count in counts], ".", color=COLOURS[0], markersize=4)
    panel.grid(False)
    panel.set_xlabel("time [s]")
    panel.set_ylabel("position\n[steps]")
    panel.legend(loc="upper left", frameon=False)
    save(figure, folder, "half_steps")


def draw_path(folder, trace):
    """One axis over the other, and the two points through which the trajectory passes."""
    events = sorted((time, axis, count) for axis in "xy" for time, count in zip(*trace.steps[axis]))
    place = {"x": 0, "y": 0}
    xs, ys = [0], [0]
    for _, axis, count in events:
        place[axis] = count
        xs.append(place["x"])
        ys.append(place["y"])
    figure, panel = plt.subplots(figsize=(6.4, 2.2))
    panel.plot(xs, ys, color=COLOURS[0])
    panel.plot([400, 800], [300, 0], "o", color=COLOURS[1], markersize=4)
    panel.set_xlabel("x [steps]")
    panel.set_ylabel("y [steps]")
    save(figure, folder, "trajectory_path")


def draw_shaper(folder, trace, frequency, until):
    """The speeds of both axes, and how far a mass that each pulls by an undamped spring is ahead of it."""
    figure, (speeds, masses) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 3.2))
    for colour, axis, label in zip(COLOURS, "xy", ("as planned", "shaped")):
        times, counts = trace.steps[axis]
        speeds.plot(*trace.curve(axis).speed(), color=colour, label=label)
        samples, values = [], []
        ahead, time, step = 0j, 0.0, 0
        for at, count in zip(times + [until], counts + [counts[-1]]):
            fine = max(1, round((at - time) * 2000))
            for i in range(1, fine + 1):
                samples.append(time + (at - time) * i / fine)
                values.append((ahead * cmath.rect(1.0, 2 * cmath.pi * frequency * (time - samples[-1]))).real)
            ahead = ahead * cmath.rect(1.0, 2 * cmath.pi * frequency * (time - at)) - (count - step)
            time, step = at, count
        masses.plot(samples, values, color=colour)
    speeds.set_ylabel("speed\n[steps/s]")
    masses.set_ylabel("mass ahead\nof axis [steps]")
    masses.set_xlabel("time [s]")
    speeds.legend(loc="best", frameon=False)
    save(figure, folder, "input_shaper")


def draw_rotor(folder, picture, trace):
    """Field and rotor over time, and by how much the field leads."""
    figure, (places, speeds, lags) = plt.subplots(3, 1, sharex=True, figsize=(6.4, 4.4))
    for colour, name in zip(COLOURS, ("field", "rotor")):
        times, values = trace.curves[name]
        places.plot(times, values, color=colour, label=name)
    begin = trace.steps["x"][0][0]
    field_times, field_speeds = trace.curve("x").speed()
    speeds.plot([time - begin for time in field_times], [speed / 16 for speed in field_speeds],
                color=COLOURS[0])
    speeds.plot(times[5:-5], [(later - earlier) / (times[10] - times[0])
                              for earlier, later in zip(values, values[10:])], color=COLOURS[1])
    lags.plot(*trace.curves["lag"], color=COLOURS[2])
    for angle in (-180, 180):
        lags.axhline(angle, color="#888888", linewidth=0.8, linestyle="--")
    lags.yaxis.set_major_locator(MultipleLocator(90))
    places.set_ylabel("position\n[full steps]")
    speeds.set_ylabel("speed\n[full steps/s]")
    lags.set_ylabel("lag [electrical\ndegrees]")
    lags.set_xlabel("time [s]")
    places.legend(loc="best", frameon=False)
    save(figure, folder, picture)


def two_panels(height=2.8):
    """A high one, and a low one below it for levels."""
    return plt.subplots(2, 1, sharex=True, figsize=(6.4, height), gridspec_kw={"height_ratios": [3, 1]})


def plot_level(panel, trace, name, label, colour, base=0.0):
    times, levels = trace.levels[name]
    panel.step(times + [trace.end()], [base + 0.8 * level for level in levels + levels[-1:]],
               where="post", color=colour)
    panel.annotate(label, (1.0, base + 0.4), xycoords=("axes fraction", "data"), xytext=(3, 0),
                   textcoords="offset points", va="center", color=colour, annotation_clip=False)


def finish_levels(panel, count=1):
    panel.set_ylim(-0.2, count)
    panel.set_yticks([])
    panel.set_xlabel("time [s]")


def draw_position_compare(folder, trace):
    """The position, with a dot where the camera was triggered, and its line."""
    figure, (places, levels) = two_panels()
    places.plot(*trace.places("x"), color=COLOURS[0], drawstyle="steps-post")
    triggers = trace.switched("camera", 1)
    places.plot(triggers, [trace.place_at("x", time) for time in triggers], "o", color=COLOURS[1],
                markersize=3, label="the camera is triggered")
    for time, words in trace.marks:
        places.axvline(time, color="#888888", linewidth=0.8, linestyle=":")
        places.annotate(words, (time, 1.0), xycoords=("data", "axes fraction"), xytext=(2, 1),
                        textcoords="offset points", color="#555555")
    plot_level(levels, trace, "camera", "camera", COLOURS[1])
    finish_levels(levels)
    places.yaxis.set_major_locator(MultipleLocator(4))
    places.set_ylabel("x [mm]")
    places.legend(loc="lower center", bbox_to_anchor=(0.55, 0.0), frameon=False)
    save(figure, folder, "position_compare")


def draw_path_outputs(folder, trace):
    """The path, with the parts on which the laser was on, and its line over time."""
    marks = [(5.0, 0.0), (30.0, 15.0), (30.0, 20.0), (30.0, 26.0)]
    figure, (plan, levels) = plt.subplots(1, 2, figsize=(6.4, 2.8), gridspec_kw={"width_ratios": [3, 2]})
    times = sorted(time for axis in "xy" for time in trace.steps[axis][0])
    positions = [(trace.place_at("x", time), trace.place_at("y", time)) for time in times]
    plan.plot(*zip(*positions), color="#aaaaaa", linewidth=0.8, label="the path")
    spans = list(zip(trace.switched("laser", 1), trace.switched("laser", 0)))
    for number, (begin, end) in enumerate(spans):
        lit = positions[bisect.bisect_left(times, begin):bisect.bisect_left(times, end)]
        plan.plot(*zip(*lit), color=COLOURS[1], linewidth=2.4, label=None if number else "the line is on")
    plan.plot(*zip(*marks), "o", color=COLOURS[0], markersize=4, label="the marks")
    plan.set_aspect("equal")
    plan.set_xlabel("x [mm]")
    plan.set_ylabel("y [mm]")
    plan.legend(loc="upper left", frameon=False)
    reached = [min(zip(times, positions), key=lambda step, mark=mark: abs(complex(*step[1]) - complex(*mark)))[0]
               for mark in marks]
    for number, time in enumerate(reached):
        levels.axvline(time, color=COLOURS[0], linewidth=0.8, linestyle=":")
        if number == 0:
            levels.annotate("at the mark", (time, 1.0), xycoords=("data", "axes fraction"), xytext=(2, 1),
                            textcoords="offset points", color=COLOURS[0])
    plot_level(levels, trace, "laser", "", COLOURS[1])
    finish_levels(levels)
    levels.set_ylabel("laser")
    save(figure, folder, "path_outputs")


def draw_probe(folder, trace):
    figure, (places, levels) = two_panels()
    places.plot(*trace.places("x"), color=COLOURS[0])
    for number, time in enumerate(trace.switched("flag1", 1)):
        places.plot(time, trace.place_at("x", time), "o", color=COLOURS[1], markersize=4,
                    label=None if number else "contact")
    places.axhline(20.0, color="#888888", linewidth=0.8, linestyle="--")
    plot_level(levels, trace, "flag1", "probe", COLOURS[1])
    finish_levels(levels)
    places.set_ylabel("x [mm]")
    places.legend(loc="lower right", frameon=False)
    save(figure, folder, "probe")


def draw_flag(folder, homings):
    """homings: (trace, where it began [mm]) for each."""
    figure, (places, levels) = two_panels()
    places.axhspan(20.0, 30.0, color="#eeeeee")
    places.annotate("the flag", (0.02, 25.0), xycoords=("axes fraction", "data"), va="center",
                    color="#555555")
    for number, (colour, (trace, start)) in enumerate(zip(COLOURS, homings)):
        times, positions = trace.places("x", start)
        places.plot(times, positions, color=colour, label=f"from {start:g} mm")
        edge = trace.switched("flag1", 1)[-1]
        places.plot(edge, positions[bisect.bisect_right(times, edge) - 1], "o", color=colour, markersize=4)
        plot_level(levels, trace, "flag1", "", colour, base=float(len(homings) - 1 - number))
    finish_levels(levels, len(homings))
    levels.set_ylabel("pressed")
    places.set_ylabel("x [mm]")
    places.legend(loc="upper right", frameon=False)
    save(figure, folder, "homing_flag")


def save(figure, folder, picture):
    look.save(figure, folder / (picture + ".svg"))


def main(traces, pictures):
    def trace(name):
        return Trace(traces, name)

    def one(name, axis="x", label=""):
        return [(trace(name), axis, label)]

    draw_half_steps(pictures, trace("half_steps"))
    draw(pictures, "trapezoid", one("trapezoid", label="1000 steps") +
         one("triangle", label="200 steps"), ["position", "speed"],
         phases=[(0.0, 0.45, "acceleration"), (0.45, 1.07875, "cruise"),
                 (1.07875, 1.30375, "deceleration")],
         levels=[(100.0, "start speed"), (1000.0, "max speed")])
    ends = [0.0, 0.1, 0.5, 0.6, 1.0, 1.1, 1.5, 1.6]
    draw(pictures, "s_curve", one("s_curve"), ["position", "speed", "acceleration"],
         phases=[(begin, end, str(i + 1)) for i, (begin, end) in enumerate(zip(ends, ends[1:]))],
         levels=[(1000.0, "max speed")])
    draw(pictures, "speed_override", one("speed_override"), ["position", "speed"])
    draw(pictures, "new_target", one("new_target"), ["position", "speed"])
    draw(pictures, "stop", one("stop"), ["position", "speed"])
    draw(pictures, "jog", one("jog"), ["position", "speed", "acceleration"])
    line = trace("line")
    draw(pictures, "line", [(line, "x", "x"), (line, "y", "y")], ["position", "speed"])
    draw(pictures, "splines", one("cubics", label="cubics") + one("quintics", label="quintics"),
         ["position", "speed", "acceleration"])
    held = trace("trajectory_hold")
    draw(pictures, "trajectory_hold", [(held, "x", "x"), (held, "y", "y")], ["position", "speed"])
    draw_path(pictures, held)
    draw_shaper(pictures, trace("input_shaper"), 8.0, 1.0)
    for name in ("rotor_follows", "rotor_falls_out"):
        draw_rotor(pictures, name, trace(name))
    draw_position_compare(pictures, trace("position_compare"))
    draw_path_outputs(pictures, trace("path_outputs"))
    draw_probe(pictures, trace("probe"))
    draw_flag(pictures, [(trace("flag_from_below"), 5.0), (trace("flag_from_above"), 45.0)])


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
