"""The shapes in librsvg's version of an SVG file, which has only paths, clips and copies."""

import itertools
import math
import re
from collections import namedtuple

from .errors import BadDrawing
from .stroke import Stroke
from .svg_clip import Region

# A curve becomes chords. Their largest distance from the curve is this part of the drawing's diagonal:
# 0.02 mm for 200 mm.
TOLERANCE = 1e-4
MARGIN = 0.5  # [px] points that are closer count as one, and the edge of a clip is exact to this
HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
PERCENT = re.compile(r"rgb\(([\d.]+)%,([\d.]+)%,([\d.]+)%\)")
NOT_SHOWN = {"defs", "clipPath", "mask", "filter", "linearGradient", "radialGradient", "pattern", "symbol"}

# element: a path or a rect; matrix: its transform; clips: Clips; colour: of its stroke or else its fill
Shape = namedtuple("Shape", "element matrix clips is_white has_dots colour")
Clip = namedtuple("Clip", "element matrix style")


class Shapes:
    """Refuses images at its construction."""

    def __init__(self, path, root):
        """path: names the file in errors."""
        import svgelements
        self._path = path
        self._svgelements = svgelements
        self._named = {element.get("id"): element for element in root.iter() if element.get("id")}
        self._regions = {}
        shapes = self._in(root, svgelements.Matrix(), (), {})
        # What is only white isn't seen on white paper, unless it hides something.
        self._shapes = list(itertools.dropwhile(lambda shape: shape.is_white, shapes))

    def strokes(self):
        """Strokes with their colours [px]."""
        outlines = [self._outline(shape.element, shape.matrix) for shape in self._shapes]
        points = [place for outline in outlines for segment in outline for place in places_of(segment)]
        if not points:
            return []
        tolerance = TOLERANCE * math.dist(*zip(*((min(values), max(values)) for values in zip(*points))))
        strokes, before = [], []
        for shape, outline in zip(self._shapes, outlines):
            own = self._clipped(visible(chords_of(outline, tolerance), shape.has_dots), shape.clips)
            # A fill and its stroke may be two shapes with the same outline.
            if own and are_same(own, before):
                strokes[-len(own):] = [Stroke(stroke, shape.colour) for stroke in own]
            else:
                strokes += [Stroke(stroke, shape.colour) for stroke in own]
            before = own
        return strokes

    def _in(self, element, matrix, clips, style):
        """The shapes in an element. matrix, clips, style: those of its parent."""
        name = name_of(element)
        if name in NOT_SHOWN:
            return
        style = {**style, **style_of(element)}
        matrix = self._transformed(element, matrix)
        if element.get("clip-path"):
            clips += (Clip(self._target(element.get("clip-path")), matrix, style),)
        # With cairo 1.18, images are composed by filters.
        if element.get("filter"):
            self._refuse_image()
        # An opacity is a mask, too, but without an image.
        if element.get("mask") and self._has_image(self._target(element.get("mask"))):
            raise BadDrawing(f"{self._path}: a mask isn't drawn: remove it in your drawing program")
        if name in ("path", "rect"):
            yield self._shape(element, matrix, clips, style)
        elif name == "use":
            target = self._used(element)
            matrix = self._svgelements.Matrix.translate(
                float(element.get("x", 0.0)), float(element.get("y", 0.0))) * matrix
            for inner in target if name_of(target) == "symbol" else [target]:
                yield from self._in(inner, matrix, clips, style)
        elif name in ("svg", "g"):
            for inner in element:
                yield from self._in(inner, matrix, clips, style)
        else:
            self._refuse_image()

    def _transformed(self, element, matrix):
        text = element.get("transform")
        return self._svgelements.Matrix(text) * matrix if text else matrix

    def _target(self, reference):
        """The element that "#name" or "url(#name)" refers to."""
        return self._named[reference.partition("#")[2].rstrip(")")]

    def _used(self, element):
        """The element that <use> copies."""
        return self._target(next(element.get(href) for href in HREFS if element.get(href)))

    def _has_image(self, element):
        return any(name_of(inner) == "image" or name_of(inner) == "use" and self._has_image(self._used(inner))
                   for inner in element.iter())

    def _refuse_image(self):
        raise BadDrawing(f"{self._path}: an image or a filter effect isn't drawn: remove it, or convert it to a "
                         "path in your drawing program")

    def _shape(self, element, matrix, clips, style):
        paints = [style.get("fill", "black"), style.get("stroke", "none")]
        paints = [paint.replace(" ", "") for paint in paints if paint != "none"]
        if any(paint.startswith("url") and self._has_image(self._target(paint)) for paint in paints):
            self._refuse_image()
        is_white = all(paint == "rgb(100%,100%,100%)" for paint in paints)
        has_dots = style.get("stroke", "none") != "none" and style.get("stroke-linecap") != "butt"
        return Shape(element, matrix, clips, is_white, has_dots, colour_of(paints[-1]) if paints else "")

    def _outline(self, element, matrix):
        if name_of(element) == "rect":
            x, y, width, height = (element.get(key, "0") for key in ("x", "y", "width", "height"))
            lines = f"M{x} {y}h{width}v{height}h-{width}z"
        else:
            lines = element.get("d", "")
        path = self._svgelements.Path(lines)
        path *= matrix
        return path.reify()

    def _clipped(self, strokes, clips):
        for clip in clips:
            region = self._region(clip)
            strokes = [part for stroke in strokes for part in region.cut(stroke)]
        return strokes

    def _region(self, clip):
        key = (clip.element.get("id"), repr(clip.matrix))
        if key not in self._regions:
            matrix = self._transformed(clip.element, clip.matrix)
            rings, even_odd = [], False
            for inner in clip.element:
                style = {**clip.style, **style_of(inner)}
                even_odd = even_odd or style.get("clip-rule") == "evenodd"
                rings += chords_of(self._outline(inner, self._transformed(inner, matrix)), MARGIN)
            self._regions[key] = Region(rings, even_odd, MARGIN)
        return self._regions[key]


def name_of(element):
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def style_of(element):
    """The versions with cairo 1.16 write a style, later ones attributes."""
    pairs = (pair.partition(":") for pair in element.get("style", "").split(";"))
    return {**element.attrib, **{key.strip(): value.strip() for key, _, value in pairs}}


def colour_of(paint):
    """#rrggbb; empty of what isn't one colour. librsvg writes percent."""
    shares = PERCENT.fullmatch(paint)
    return "#" + "".join(f"{round(2.55 * float(share)):02x}" for share in shares.groups()) if shares else ""


def visible(strokes, has_dots):
    """has_dots: whether a viewer shows a line without a length."""
    shown = []
    for stroke in strokes:
        if any(math.dist(stroke[0], point) > MARGIN for point in stroke):
            shown.append(stroke)
        elif len(stroke) > 1 and has_dots and not are_same([stroke[:1]], shown[-1:]):
            shown.append(stroke[:1])
    return shown


def are_same(some, others):
    """Whether strokes are the same, apart from rounding errors."""
    return [len(stroke) for stroke in some] == [len(stroke) for stroke in others] and all(
        math.dist(here, there) <= 2.0 * MARGIN
        for stroke, other in zip(some, others) for here, there in zip(stroke, other))


def places_of(segment):
    """The points that determine a segment."""
    points = [getattr(segment, name, None) for name in ("start", "control1", "control2", "end")]
    return [(point.x, point.y) for point in points if point is not None]


def chords_of(path, tolerance):
    """Lists of points along each part of a path, which librsvg writes with lines and cubic curves."""
    strokes = []
    for segment in path:
        places = places_of(segment)
        if type(segment).__name__ == "Move":
            strokes.append(places[-1:])
        elif len(places) == 4:
            strokes[-1] += chords(*places, tolerance)
        else:
            strokes[-1] += places[-1:]
    return strokes


def chords(begin, control, other, end, tolerance):
    """The ends of equal steps along a cubic curve. Its distance from a chord is at most 1/8 of the curve's
    second derivative times the square of the step, and that derivative is largest at one end."""
    second = 6.0 * max(math.hypot(*(a - 2.0 * b + c for a, b, c in zip(*three)))
                       for three in ((begin, control, other), (control, other, end)))
    count = max(1, math.ceil(math.sqrt(second / (8.0 * tolerance)))) if tolerance > 0.0 else 1
    points = []
    for index in range(1, count):
        t = index / count
        s = 1.0 - t
        points.append(tuple(s ** 3 * p + 3.0 * s * s * t * c + 3.0 * s * t * t * o + t ** 3 * e
                            for p, c, o, e in zip(begin, control, other, end)))
    return points + [end]
