"""The style of the pictures, and the graphs of motions and drawings."""

import sys
import warnings

try:
    import matplotlib
except ImportError:
    sys.exit("Pictures are drawn by matplotlib: apt install python3-matplotlib")

from .errors import Undrawable, refuse_endless  # noqa: E402: matplotlib comes first

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402: the backend comes first
from matplotlib.ticker import (FuncFormatter, LogLocator, MaxNLocator, MultipleLocator,  # noqa: E402
                               NullFormatter)  # noqa: E402

# Older versions, as in Ubuntu 20.04, measure their texts with another backend, and say so.
warnings.filterwarnings("ignore", message="tight_layout : falling back to Agg renderer")

# With a fixed hash salt, the same motion gives the same file.
matplotlib.rcParams.update({
    "svg.hashsalt": "stepdriver",
    "svg.fonttype": "none",
    "font.size": 8,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dddddd",
    "lines.linewidth": 1.2,
    "path.simplify_threshold": 0.3,
})
COLOURS = ["#1f6fb4", "#d9661f", "#2b8a3e", "#8a3ea8", "#7a6a20", "#555555"]
# The times of edges are whole nanoseconds. With this many samples, their third differences stay above
# the noise.
SAMPLES = 250


def refuse_unwritable(path):
    """Called before anything moves, so that no motion is without its picture."""
    refuse_endless(path)
    is_new = not path.exists()
    try:
        with open(path, "ab"):
            pass
    except OSError as error:
        raise Undrawable(f"{path}: can't be written: {error.strerror}") from error
    if is_new:
        path.unlink()


def save(figure, path):
    figure.tight_layout()
    metadata = {"Date": None, "Creator": None} if path.suffix == ".svg" else {"Software": None}
    figure.savefig(path, metadata=metadata, dpi=150)
    plt.close(figure)


def draw_motion(curves, path, title="", deflections=()):
    """Draws one or more axes with the same unit: velocity and step period over position; position,
    velocity, acceleration and jerk over time. deflections: (label, times, values) of masses that they pull
    along by springs."""
    unit = curves[0].unit
    if deflections:
        figure, panels = plt.subplots(4, 2, figsize=(9.6, 9.6))
        draw_deflections(figure, panels[3], deflections, unit)
    else:
        figure, panels = plt.subplots(3, 2, figsize=(9.6, 7.2))
    with_jerk = [curve for curve in curves if curve.has_jerk_limit]
    for curve, colour in zip(curves, COLOURS * len(curves)):
        coarse = curve.coarse(SAMPLES)
        for panel, (xs, ys) in (
                (panels[0, 0], curve.speed_over_position()),
                (panels[1, 0], curve.period_over_position() if curve.step else ([], [])),
                (panels[2, 0], curve.position()),
                (panels[0, 1], curve.speed()),
                (panels[1, 1], coarse.acceleration()),
                (panels[2, 1], coarse.jerk() if curve in with_jerk else ([], []))):
            panel.plot(xs, ys, color=colour, label=curve.label)
    place, time = f"position [{unit}]", "time [s]"
    for panel, x, y in ((panels[0, 0], place, f"velocity [{unit}/s]"),
                        (panels[1, 0], place, "step period [us]"),
                        (panels[2, 0], time, place),
                        (panels[0, 1], time, f"velocity [{unit}/s]"),
                        (panels[1, 1], time, f"acceleration [{unit}/s$^2$]"),
                        (panels[2, 1], time, f"jerk [{unit}/s$^3$]")):
        panel.set_xlabel(x)
        panel.set_ylabel(y)
    for panel in (panels[0, 0], panels[0, 1]):
        include_zero(panel)
    if any(curve.step for curve in curves):
        logarithmic(panels[1, 0])
    else:
        say_instead(panels[1, 0], "step periods need the steps per unit")
    if not with_jerk:
        say_instead(panels[2, 1], "no jerk to show: the acceleration jumps")
    if len(curves) > 1:
        legend_above(panels[0, 0])
    figure.suptitle(title)
    save(figure, path)


def draw_spectrum(frequencies, responses, shapers, path, axis):
    """What an accelerometer shows of the oscillations of an axis. shapers: (name, frequency, the part that
    it leaves at each of the frequencies)."""
    figure, panel = plt.subplots(figsize=(6.4, 3.2))
    panel.plot(frequencies, responses, ".-", color=COLOURS[0], label="measured")
    for (name, frequency, left), colour in zip(shapers, COLOURS[1:]):
        panel.plot(frequencies, [part * response for part, response in zip(left, responses)],
                   color=colour, label=f"with {name} for {frequency:.1f} Hz")
        panel.axvline(frequency, color=colour, linewidth=0.8, linestyle=":")
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel(f"acceleration,\nover that of {axis}")
    legend_above(panel)
    save(figure, path)


def draw_loads(ways, stall, path, axis, unit):
    """What a driver chip has measured of its load. ways: (name, positions, values of SG_RESULT). stall: the
    value from which on it is a stall."""
    figure, panel = plt.subplots(figsize=(6.4, 3.2))
    for (name, positions, loads), colour in zip(ways, COLOURS):
        panel.plot(positions, loads, ".-", color=colour, label=name)
    panel.axhline(stall, color="#222222", linewidth=0.8, linestyle="--", label="stall, as proposed")
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel(f"position of {axis} [{unit}]")
    panel.set_ylabel("SG_RESULT")
    legend_above(panel)
    save(figure, path)


def draw_deflections(figure, row, deflections, unit):
    """In place of the panels of a row."""
    grid = row[0].get_gridspec()
    for panel in row:
        panel.remove()
    panel = figure.add_subplot(grid[3, :])
    for (label, times, values), colour in zip(deflections, COLOURS * len(deflections)):
        panel.plot(times, values, color=colour, label=label)
    panel.set_xlabel("time [s]")
    panel.set_ylabel(f"deflection [{unit}]")
    legend_above(panel)


def include_zero(panel):
    """Lets the vertical axis begin or end at 0 if all values are on one side of it."""
    low, high = panel.dataLim.intervaly
    if low >= 0.0:
        panel.set_ylim(bottom=0.0)
    elif high <= 0.0:
        panel.set_ylim(top=0.0)


def logarithmic(panel):
    """The periods at the ends of a ramp are a hundred times those at full speed."""
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())


def legend_above(panel):
    """Shows the legend outside of the panel, so that it covers no curve."""
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=4, frameon=False, borderpad=0.0)


def say_instead(panel, text):
    """Shows a text in place of a graph and its axes."""
    panel.set_axis_off()
    panel.text(0.5, 0.5, text, ha="center", va="center", transform=panel.transAxes,
               color="#777777")


def same_ticks(panel):
    """Gives both axes, whose scales are equal, the same distance between ticks."""
    spans = [high - low for low, high in (panel.get_xlim(), panel.get_ylim())]
    step = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(0.0, max(spans))[1]
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MultipleLocator(step))


def draw_drawing(lines, parts, limits, path, title, axes=("x", "y"), dots=()):
    """Draws the lines and dots, and over them the path of the axes. parts: (positions, whether they belong to
    the drawing). If both axes have both limits, a frame shows them."""
    figure, panel = plt.subplots(figsize=(6.4, 5.6))
    labels = {}
    (left, right), (low, high) = limits
    if None not in (left, right, low, high):
        labels["soft limits"], = panel.plot([left, right, right, left, left],
                                            [low, low, high, high, low],
                                            color="#222222", linewidth=0.8, linestyle="--")
    for begin, end in (line[:2] for line in lines if line[2]):
        labels["lines of the drawing"], = panel.plot(
            *zip(begin, end), color=COLOURS[1], linewidth=3.0, alpha=0.25, solid_capstyle="round")
    for dot in dots:
        labels["dots of the drawing"], = panel.plot(*dot, "o", color=COLOURS[1], alpha=0.25)
    for places, drawn in parts:
        if len(places) > 1:
            name = "where the axes were" if drawn else "way between strokes"
            labels[name], = panel.plot(*zip(*places), color=COLOURS[0] if drawn else COLOURS[2],
                                       linewidth=1.0 if drawn else 0.8, linestyle="-" if drawn else ":")
    panel.set_aspect("equal")
    same_ticks(panel)
    panel.set_xlabel(f"{axes[0]} [mm]")
    panel.set_ylabel(f"{axes[1]} [mm]")
    panel.legend(labels.values(), labels.keys(), loc="upper center",
                 bbox_to_anchor=(0.5, -0.12), ncol=3, frameon=False)
    panel.set_title(title)
    save(figure, path)
