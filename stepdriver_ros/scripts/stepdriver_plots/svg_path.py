"""Reads the lines of an SVG file with svgelements, which handles shapes, curves and transforms."""

import math
import xml.etree.ElementTree as xml

from .drawn_path import offset
from .errors import BadDrawing

# A curve becomes chords. Their largest distance from the curve is this part of the drawing's diagonal:
# 0.02 mm for 200 mm.
TOLERANCE = 1e-4
PARTS = 2**12  # a curve becomes at most this many chords
FARTHEST = 1e100  # units: squares of distances are finite
MOST_COPIES = 10000  # of elements, that <use> may make
HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
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
        refuse_endless_copies(path)
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
    refuse_far_places(path, segments)
    return strokes_of(path, segments, svgelements)


def refuse_endless_copies(path):
    """svgelements copies an element for each <use> of it, also in an element that uses itself."""
    elements = list(xml.parse(path).getroot().iter())
    named = {}
    for element in elements:
        named.setdefault(element.get("id"), []).append(element)
    sizes = {}  # of an element with its copies; None while it is counted

    def size(element):
        if element not in sizes:
            sizes[element] = None
            used = [other for href in HREFS if is_use(element) and element.get(href)
                    for other in named.get(element.get(href)[1:], ())]
            sizes[element] = 1 + sum(size(other) for other in [*element, *used])
        if sizes[element] is None:
            raise BadDrawing(f"{path}: <use> copies the element {element.get('id')!r} into itself")
        return sizes[element]

    copies = size(elements[0]) - len(elements)
    if copies > MOST_COPIES:
        raise BadDrawing(f"{path}: its <use> make {copies} copies of elements; at most {MOST_COPIES} "
                         "are allowed")


def is_use(element):
    return isinstance(element.tag, str) and element.tag.rpartition("}")[2] == "use"


def refuse_undrawable(path, svg, svgelements):
    for element in svg.elements():
        if isinstance(element, (svgelements.Text, svgelements.Image)):
            raise BadDrawing(f"{path}: {type(element).__name__.lower()} isn't drawn: convert it to "
                             "a path in your drawing program")


def refuse_far_places(path, segments):
    for segment in segments:
        for point in (segment.start, segment.end):
            if point is not None:
                refuse_far(path, point.x, point.y)


def refuse_far(path, x, y):
    if not (abs(x) <= FARTHEST and abs(y) <= FARTHEST):
        raise BadDrawing(f"{path}: has a point at ({x}, {y}); a drawing reaches to {FARTHEST:g}")


def strokes_of(path, segments, svgelements):
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
        elif segment.start is None:
            raise BadDrawing(f"{path}: a path begins with a line or a curve to "
                             f"({segment.end.x:g}, {segment.end.y:g}); begin it with a move (M or m)")
        elif isinstance(segment, svgelements.Linear):
            strokes[-1].append(place(segment.end))
        else:
            strokes[-1] += Curve(path, segment).chords(tolerance)
    return [stroke for stroke in strokes if len(stroke) > 1]


def place(point):
    return point.x, point.y


class Curve:
    """Places of a curve at equal steps of its parameter."""

    def __init__(self, path, segment):
        self._path = path
        self._places = segment.npoint([i / PARTS for i in range(PARTS + 1)])

    def at(self, index):
        x, y = self._places[index]
        refuse_far(self._path, x, y)
        return float(x), float(y)

    def chords(self, tolerance, begin=0, end=PARTS):
        """The end points of chords along a part of the curve."""
        ends = self.at(begin), self.at(end)
        if end == begin + 1:
            return [ends[1]]
        middle = (begin + end) // 2
        # The middle alone isn't enough: a curve may cross its chord there.
        off = max(math.hypot(*offset(self.at(index), *ends))
                  for index in (middle, (begin + middle) // 2, (middle + end) // 2))
        if off <= tolerance and end - begin < PARTS // 2:
            return [ends[1]]
        return self.chords(tolerance, begin, middle) + self.chords(tolerance, middle, end)
