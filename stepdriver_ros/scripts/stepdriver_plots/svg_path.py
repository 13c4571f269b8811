"""Reads the lines of an SVG file with svgelements, which handles shapes, curves and transforms."""

import math
import xml.etree.ElementTree as xml

from .drawn_path import offset
from .errors import BadDrawing

# A curve becomes chords. Their largest distance from the curve is this part of the drawing's diagonal:
# 0.02 mm for 200 mm.
TOLERANCE = 1e-4
FINEST = 12  # a curve is halved at most this many times
MM_PER_INCH = 25.4  # a file in mm, cm or inches is read in mm


def read_svg(path):
    """Strokes: lists of points (x, y), with y pointing down, in mm if the file has a physical size,
    otherwise in its own units."""
    try:
        import svgelements
    except ImportError as error:
        raise BadDrawing("SVG files are read by svgelements: apt install python3-svgelements "
                         f"({error})") from error
    try:
        svg = svgelements.SVG.parse(str(path), ppi=MM_PER_INCH)
        segments = [segment for element in svg.elements()
                    if isinstance(element, svgelements.Shape)
                    for segment in svgelements.Path(element)]
        refuse_undrawable(path, svg, svgelements)
    except (OSError, xml.ParseError, LookupError, ValueError, TypeError, AttributeError,
            ArithmeticError) as error:
        raise BadDrawing(f"{path}: can't be read as SVG: {error}") from error
    except RecursionError as error:
        raise BadDrawing(f"{path}: its groups are nested too deeply to be read") from error
    refuse_endless_places(path, segments)
    return strokes_of(segments, svgelements)


def refuse_undrawable(path, svg, svgelements):
    for element in svg.elements():
        if isinstance(element, (svgelements.Text, svgelements.Image)):
            raise BadDrawing(f"{path}: {type(element).__name__.lower()} isn't drawn: convert it to "
                             "a path in your drawing program")


def refuse_endless_places(path, segments):
    for segment in segments:
        for point in (segment.start, segment.end):
            if point is not None and not (math.isfinite(point.x) and math.isfinite(point.y)):
                raise BadDrawing(f"{path}: has a point at ({point.x}, {point.y}), which isn't "
                                 "finite")


def strokes_of(segments, svgelements):
    points = [point for segment in segments for point in (segment.start, segment.end)
              if point is not None]
    if not points:
        return []
    tolerance = TOLERANCE * math.hypot(max(p.x for p in points) - min(p.x for p in points),
                                       max(p.y for p in points) - min(p.y for p in points))
    strokes = []
    for segment in segments:
        if segment.end is None:
            continue
        if isinstance(segment, svgelements.Move):
            strokes.append([place(segment.end)])
        elif isinstance(segment, svgelements.Linear):
            strokes[-1].append(place(segment.end))
        else:
            strokes[-1] += chords(segment, 0.0, 1.0, tolerance, FINEST)
    return [stroke for stroke in strokes if len(stroke) > 1]


def place(point):
    return point.x, point.y


def chords(curve, begin, end, tolerance, halvings):
    """The end points of chords along a part of a curve."""
    middle = (begin + end) / 2
    ends = [place(curve.point(t)) for t in (begin, end)]
    # The middle alone isn't enough: a curve may cross its chord there.
    off = max(math.hypot(*offset(place(curve.point(t)), *ends))
              for t in (middle, (begin + middle) / 2, (middle + end) / 2))
    if halvings == 0 or off <= tolerance and halvings < FINEST - 1:
        return [ends[1]]
    return (chords(curve, begin, middle, tolerance, halvings - 1) +
            chords(curve, middle, end, tolerance, halvings - 1))
