"""A drawing: strokes in millimetres on two axes. A stroke of one point is a dot."""

import math

from .errors import BadDrawing, refuse_endless
from .stroke import Stroke
from .svg_path import read_svg

MARGIN = 0.05  # part of the smaller side that stays free if a drawing is fitted into the axes' limits


def read_drawing(path):
    """The strokes of a file, and whether they are positions in mm. An SVG's have to be placed first."""
    refuse_endless(path)
    if path.suffix.lower() == ".svg":
        strokes, in_place = read_svg(path), False
        # In an SVG, y points down; on the axes, it points up.
        strokes = [stroke.at((x, -y) for x, y in stroke) for stroke in strokes]
    else:
        strokes, in_place = [Stroke(points) for points in read_points(path)], True
    strokes = [stroke.at(without_repeats(stroke)) for stroke in strokes]
    if not strokes:
        raise BadDrawing(f"{path}: contains no line")
    return strokes, in_place


def read_points(path):
    """Reads lines of `x y` or `x, y` in mm. An empty line begins a new stroke, # a comment."""
    strokes = [[]]
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadDrawing(f"{path}: {error}") from error
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            strokes[-1].append(point(words, f"{path}, line {number}: {line.strip()}"))
        elif "#" not in line and strokes[-1]:
            strokes.append([])
    return [stroke for stroke in strokes if stroke]


def point(words, where):
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise BadDrawing(f"{where}: isn't a point; a point is two numbers in mm, x and y") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise BadDrawing(f"{where}: isn't a point; both numbers must be finite")
    return x, y


def without_repeats(stroke):
    return stroke[:1] + [there for here, there in zip(stroke, stroke[1:]) if there != here]


def bounds(strokes):
    """(least x, greatest x), (least y, greatest y)"""
    points = [point for stroke in strokes for point in stroke]
    return tuple((min(values), max(values)) for values in zip(*points))


def placed(strokes, limits, scale=None, corner=None):
    """The strokes at their positions in mm.

    scale: mm per unit; by default as large as the limits allow. corner: position of the lower left
    corner [mm]; by default the drawing is centred between the limits.
    """
    box = bounds(strokes)
    sizes = [high - low for low, high in box]
    if scale is None or corner is None:
        if any(value is None for limit in limits for value in limit):
            raise BadDrawing("the axes have no soft limits to fit the drawing into: give --scale "
                             "and --corner")
    if scale is None:
        rooms = [high - low for low, high in limits]
        free = [room - 2 * MARGIN * min(rooms) for room in rooms]
        scale = min((room / size for room, size in zip(free, sizes) if size > 0.0), default=1.0)
    if corner is None:
        corner = [(low + high - scale * size) / 2 for (low, high), size in zip(limits, sizes)]
    there = [Stroke((tuple(at + scale * (value - low) for at, value, (low, _) in zip(corner, point, box))
                     for point in stroke), getattr(stroke, "colour", "")) for stroke in strokes]
    if not all(math.isfinite(value) for stroke in there for point in stroke for value in point):
        raise BadDrawing(f"the drawing can't be scaled: it is {sizes[0]:.6g} wide and {sizes[1]:.6g} "
                         "high")
    return there


def refuse_beyond(strokes, axes, limits):
    """Called before anything moves, so that no drawing is left unfinished."""
    for stroke in strokes:
        for place in stroke:
            for axis, value, (low, high) in zip(axes, place, limits):
                below = low is not None and value < low - 1e-9
                above = high is not None and value > high + 1e-9
                if below or above:
                    raise BadDrawing(
                        f"the point ({place[0]:.6g}, {place[1]:.6g}) mm is "
                        f"{'below' if below else 'above'} the soft limit of {axis}, "
                        f"{low if below else high:.6g} mm")


def refuse_too_fast(lines, axes, speeds, speed):
    """speeds: the maximum of each axis alone [mm/s]. The node refuses a line that is too fast; this
    refuses the drawing before its first line."""
    for begin, end, _ in lines:
        ways = [abs(there - here) for here, there in zip(begin, end)]
        time = max(way / most for way, most in zip(ways, speeds))
        allowed = math.dist(begin, end) / time
        if speed > allowed * (1 + 1e-9):
            raise BadDrawing(
                f"the speed {speed:.6g} mm/s is above the {allowed:.6g} mm/s that {axes[0]} and "
                f"{axes[1]} allow from ({begin[0]:.6g}, {begin[1]:.6g}) to "
                f"({end[0]:.6g}, {end[1]:.6g}) mm")


def segments(start, strokes):
    """Yields (from, to, whether it is part of the drawing) for each line, also for those between
    strokes."""
    here = start
    for stroke in strokes:
        for i, there in enumerate(stroke):
            if there != here:
                yield here, there, i > 0
            here = there
