"""A program of its own, which reads an SVG file from its standard input and writes its strokes as JSON. A file
that takes all of the time or the memory ends only this program, which drawing.py starts."""

import json
import math
import pathlib
import resource
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from stepdriver_plots import drawing  # noqa: E402: the path comes first
from stepdriver_plots.errors import BadDrawing, Undrawable  # noqa: E402

LONGEST = 60  # [s] of processor time
MEMORY = 2 << 30  # [bytes]
MOST_POINTS = 20000  # as many segments as a path may have; draw splits longer ones
DIGITS = 5  # after the point, in mm
CORNER = math.radians(1.0)  # a smaller turn is part of a curve


def limit():
    for kind, most in ((resource.RLIMIT_CPU, LONGEST), (resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CORE, 0)):
        resource.setrlimit(kind, (most, most))


def corners(stroke):
    """The number of points at which a stroke turns."""
    directions = [math.atan2(there[1] - here[1], there[0] - here[0]) for here, there in zip(stroke, stroke[1:])]
    turns = (abs(math.remainder(new - old, math.tau)) for old, new in zip(directions, directions[1:]))
    return sum(turn > CORNER for turn in turns)


def read(document, options):
    """The strokes on the axes, and what is wrong with them."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "drawing.svg"
        path.write_bytes(document)
        try:
            strokes, _ = drawing.read_drawing(path)
        except Undrawable as error:
            raise BadDrawing(str(error).replace(str(path), "the drawing")) from None
    points = sum(len(stroke) for stroke in strokes)
    if points > MOST_POINTS:
        raise BadDrawing(f"the drawing has {points} points; from the page at most {MOST_POINTS} are drawn. "
                         "The program draw has no such limit")
    limits = [tuple(pair) for pair in options["limits"]]
    strokes = drawing.placed(strokes, limits, options["scale"], options["corner"])
    strokes = [drawing.without_repeats([tuple(round(value, DIGITS) for value in point) for point in stroke])
               for stroke in strokes]
    answer = {"strokes": strokes, "corners": sum(map(corners, strokes)), "problem": ""}
    try:
        drawing.refuse_beyond(strokes, options["axes"], limits)
    except BadDrawing as error:
        answer["problem"] = str(error)
    return answer


def main():
    limit()
    try:
        answer = read(sys.stdin.buffer.read(), json.loads(sys.argv[1]))
    except Undrawable as error:
        answer = {"problem": str(error)}
    except (MemoryError, RecursionError):
        answer = {"problem": "the drawing takes more memory than the panel allows"}
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
