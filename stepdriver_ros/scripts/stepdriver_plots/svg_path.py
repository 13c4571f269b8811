"""Reads the lines of an SVG file: what a viewer shows of it on white paper."""

import math
import re
import xml.etree.ElementTree as xml
from collections import namedtuple

from .errors import BadDrawing
from .librsvg import interpreted
from .svg_clip import Region
from .svg_shapes import HREFS, MARGIN, Shapes, name_of

LARGEST = 32 << 20  # [bytes] of a file
MM_PER_PX = 25.4 / 96.0
PHYSICAL = re.compile(r"\s*[+]?[\d.]+(e[+-]?\d+)?(mm|cm|in|pt|pc|q)\s*", re.IGNORECASE)
ABSOLUTE = re.compile(r"\s*[+]?[\d.]+(e[+-]?\d+)?([a-z]*)\s*", re.IGNORECASE)
DEFAULT_SIZE = (300.0, 150.0)  # [px] of an SVG that states none, in CSS

# librsvg rounds places to 1/256 px. So a page becomes this large, and 200 mm have steps of 0.05 um.
LARGE_PAGE = 1 << 14  # [px] of its longer side
# librsvg leaves out the outline of a fill without a width or a height, such as a line along an axis whose
# stroke isn't set. It measures that along its own axes, so the page leans: no usual line is along them then.
LEAN = (0.0171, 0.0123)
WIDE = 1 << 20  # [px] a drawing without a size is searched this far to each side

# librsvg knows no quarter millimetres, and takes the names of CSS properties for case-sensitive.
QUARTERS = re.compile(r"\s*([+-]?[\d.]+(?:e[+-]?\d+)?)q\s*", re.IGNORECASE)
LENGTHS = ("x", "y", "width", "height", "x1", "y1", "x2", "y2", "cx", "cy", "r", "rx", "ry", "stroke-width",
           "font-size")
PROPERTY = re.compile(r"(?:^|[;{/])\s*[A-Za-z-]+\s*:")
# In place of each image: only whether one is shown matters.
PIXEL = ("data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR42mNgAAAAAgAB5S"
         "fe/AAAAABJRU5ErkJggg==")

Box = namedtuple("Box", "x y width height")  # [px]


def read_svg(path):
    """Strokes with their colours: points (x, y), with y pointing down, in mm if the file has a physical size,
    otherwise in px. A stroke of one point is a dot."""
    try:
        import svgelements  # noqa: F401: svg_shapes uses it
    except ImportError as error:
        raise BadDrawing("SVG files are read by svgelements: apt install python3-svgelements "
                         f"({error})") from error
    try:
        root = parsed(path)
        page = Page(path, root)
        unit = MM_PER_PX if is_physical(root) else 1.0
        return [stroke.at((x * unit, y * unit) for x, y in stroke) for stroke in page.strokes()]
    except (OSError, xml.ParseError, LookupError, ValueError, TypeError, AttributeError,
            ArithmeticError) as error:
        raise BadDrawing(f"{path}: can't be read as SVG: {error}") from error
    except RecursionError as error:
        raise BadDrawing(f"{path}: its groups are nested too deeply to be read") from error


def parsed(path):
    """The root of the file, without anything that is elsewhere."""
    size = path.stat().st_size
    if size > LARGEST:
        raise BadDrawing(f"{path}: has {size} bytes; at most {LARGEST} are allowed")
    root = xml.parse(path).getroot()
    if name_of(root) != "svg":
        raise BadDrawing(f"{path}: can't be read as SVG: it begins with <{name_of(root)}>")
    for element in root.iter():
        remove_references(path, element)
        spell_as_librsvg(element)
    return root


def remove_references(path, element):
    for href in HREFS:
        address = element.get(href)
        if address is None:
            continue
        if name_of(element) == "image":
            element.set(href, PIXEL)
        elif name_of(element) == "use" and not address.strip().startswith("#"):
            raise BadDrawing(f"{path}: <use> copies {address!r}; only elements of the file itself can be copied")


def spell_as_librsvg(element):
    for key in LENGTHS:
        quarters = QUARTERS.fullmatch(element.get(key, ""))
        if quarters:
            element.set(key, f"{float(quarters.group(1)) / 4.0!r}mm")
    if element.get("style"):
        element.set("style", PROPERTY.sub(lambda found: found.group().lower(), element.get("style")))
    if name_of(element) == "style" and element.text:
        element.text = PROPERTY.sub(lambda found: found.group().lower(), element.text)


def is_physical(root):
    return any(PHYSICAL.fullmatch(root.get(side, "")) for side in ("width", "height"))


def has_size(root):
    return root.get("viewBox") is not None or all(
        ABSOLUTE.fullmatch(root.get(side, "")) for side in ("width", "height"))


class Page:
    """The page of an SVG file, with what is shown on it."""

    def __init__(self, path, root):
        self._path = path
        self._root = root

    def strokes(self):
        """[px]"""
        if has_size(self._root):
            natural = interpreted(xml.tostring(self._root), self._path)
            Shapes(self._path, natural)  # Refuses images while they are small.
            box = Box(0.0, 0.0, *(float(natural.get(side)) for side in ("width", "height")))
            return self._strokes_in(box, box[2:], True)
        wide = Box(-WIDE, -WIDE, 2.0 * WIDE, 2.0 * WIDE)
        points = [point for stroke in self._strokes_in(wide, DEFAULT_SIZE, False, 2.0 * WIDE)
                  for point in stroke]
        if not points:
            return []
        (left, right), (top, bottom) = ((min(values) - 1.0, max(values) + 1.0) for values in zip(*points))
        return self._strokes_in(Box(left, top, right - left, bottom - top), DEFAULT_SIZE, False)

    def _strokes_in(self, box, size, is_clipped, large=LARGE_PAGE):
        """The strokes in a part of the page [px], read from a picture of it whose longer side is large.
        size: of the page."""
        leaning = Leaning(box, large)
        large_root = interpreted(xml.tostring(leaning.wrapped(self._root, size)), self._path)
        strokes = Shapes(self._path, large_root).strokes()
        if is_clipped and not all(leaning.is_on_page(point) for stroke in strokes for point in stroke):
            page = Region([leaning.corners()], False, MARGIN)
            strokes = [stroke.at(part) for stroke in strokes for part in page.cut(stroke)]
        return [stroke.at(leaning.back(point) for point in stroke) for stroke in strokes]


class Leaning:
    """How a page becomes large and leans in what librsvg interprets."""

    def __init__(self, box, large):
        self._box = box
        self._scale = large / max(box.width, box.height)

    def there(self, point):
        x, y = point[0] - self._box.x, point[1] - self._box.y
        return self._scale * (x + LEAN[0] * y), self._scale * (LEAN[1] * x + y)

    def back(self, point):
        x, y = (value / self._scale / (1.0 - LEAN[0] * LEAN[1]) for value in point)
        return x - LEAN[0] * y + self._box.x, y - LEAN[1] * x + self._box.y

    def corners(self):
        right, bottom = self._box.x + self._box.width, self._box.y + self._box.height
        return [self.there(corner) for corner in ((self._box.x, self._box.y), (right, self._box.y),
                                                  (right, bottom), (self._box.x, bottom))]

    def is_on_page(self, point):
        x, y = self.back(point)
        margin = MARGIN / self._scale
        return (-margin <= x - self._box.x <= self._box.width + margin
                and -margin <= y - self._box.y <= self._box.height + margin)

    def wrapped(self, root, size):
        """A document that contains another, whose page has a size [px]."""
        width, height = (math.ceil(max(values)) for values in zip(*self.corners()))
        steps = [self._scale * step for step in (1.0, LEAN[1], LEAN[0], 1.0)]
        matrix = ",".join(repr(value) for value in [*steps, *self.there((0.0, 0.0))])
        outer = xml.Element(root.tag, {"style": f"{sized((width, height))};transform:matrix({matrix})"})
        inner = xml.SubElement(outer, root.tag, {**root.attrib, "x": "0", "y": "0"})
        inner.set("style", f"{root.get('style', '')};{sized(size)};overflow:visible!important")
        inner.text = root.text
        inner.extend(root)
        return outer


def sized(size):
    """The style of a size [px]. Rules of the file for its root would apply to both roots."""
    return f"width:{size[0]!r}px!important;height:{size[1]!r}px!important"
