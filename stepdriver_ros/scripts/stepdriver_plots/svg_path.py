"""Reads the straight lines of an SVG file: polyline, polygon, line, rect, and path of M L H V Z."""

import math
import re
import xml.etree.ElementTree as xml

from .errors import BadDrawing

NAMESPACE = "{http://www.w3.org/2000/svg}"
GROUPS = ("svg", "g", "a")
SILENT = ("title", "desc", "metadata", "defs", "style", "script", "symbol", "clipPath")
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
TOKEN = re.compile(rf"\s*,?\s*({NUMBER}|[A-Za-z])")
COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "Z": 0}


def read_svg(path):
    """Strokes: lists of points (x, y) in the file's units, y downwards."""
    try:
        root = xml.parse(path).getroot()
    except (OSError, xml.ParseError) as error:
        raise BadDrawing(f"{path}: can't be read as SVG: {error}") from error
    if root.tag not in ("svg", NAMESPACE + "svg"):
        raise BadDrawing(f"{path}: its root is {root.tag}, not svg")
    strokes = []
    try:
        collect(root, strokes)
    except BadDrawing as error:
        raise BadDrawing(f"{path}: {error}") from error
    except RecursionError as error:
        raise BadDrawing(f"{path}: its groups are nested too deeply to be read") from error
    return strokes


def collect(element, strokes):
    namespace, _, name = element.tag.rpartition("}")
    if namespace not in ("", NAMESPACE[:-1]) or name in SILENT:
        return
    if "transform" in element.attrib:
        raise BadDrawing(f"{name} has a transform, which isn't taken: apply it in the program that "
                         "the file comes from")
    if name in GROUPS:
        for child in element:
            if isinstance(child.tag, str):  # no comment
                collect(child, strokes)
    elif name in SHAPES:
        strokes += [stroke for stroke in SHAPES[name](element) if len(stroke) > 1]
    else:
        raise BadDrawing(f"{name} isn't drawn: only {', '.join(SHAPES)} are; make it a path of "
                         "straight segments")


def attributes(element, *names):
    return [one_number(element.get(name, "0"), name) for name in names]


def one_number(text, name):
    if re.fullmatch(NUMBER, text.strip()) and math.isfinite(float(text)):
        return float(text)
    raise BadDrawing(f"{name}=\"{text}\" isn't a finite number without a unit")


def line(element):
    x1, y1, x2, y2 = attributes(element, "x1", "y1", "x2", "y2")
    return [[(x1, y1), (x2, y2)]]


def rect(element):
    x, y, width, height, rx, ry = attributes(element, "x", "y", "width", "height", "rx", "ry")
    if rx or ry:
        raise BadDrawing("rect has round corners, which aren't drawn")
    return [[(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]]


def polyline(element):
    words = element.get("points", "").replace(",", " ").split()
    if len(words) % 2:
        raise BadDrawing(f"points has {len(words)} numbers, which isn't an even number")
    numbers = [one_number(word, "points") for word in words]
    return [list(zip(numbers[::2], numbers[1::2]))]


def polygon(element):
    stroke, = polyline(element)
    return [stroke + stroke[:1]]


def path(element):
    return PathReader(element.get("d", "")).strokes


SHAPES = {"polyline": polyline, "polygon": polygon, "line": line, "rect": rect, "path": path}


class PathReader:
    """The strokes of a path's d."""

    def __init__(self, text):
        self.strokes = []
        self._here = (0.0, 0.0)
        tokens = self._split(text)
        while tokens:
            letter = tokens.pop(0)
            if letter.upper() not in COUNTS:
                raise BadDrawing(
                    f"d has {letter} where only the commands {' '.join(COUNTS)} are drawn, in "
                    "capitals or not: curves have to be made straight segments first")
            if not self.strokes and letter.upper() != "M":
                raise BadDrawing(f"d begins with {letter}, but must begin with M")
            self._command(letter, tokens)

    @staticmethod
    def _split(text):
        tokens, at = [], 0
        while text[at:].strip(" \t\r\n,"):
            match = TOKEN.match(text, at)
            if not match:
                raise BadDrawing(f"d can't be read from \"{text[at:at + 20].strip()}\" on")
            tokens.append(match.group(1))
            at = match.end()
        return tokens

    def _command(self, letter, tokens):
        count = COUNTS[letter.upper()]
        if count == 0:
            self._here = self.strokes[-1][0]
            self.strokes[-1].append(self._here)
            self.strokes.append([self._here])
            return
        first = True
        while first or (tokens and not tokens[0].isalpha()):
            if len(tokens) < count or any(token.isalpha() for token in tokens[:count]):
                raise BadDrawing(f"d has too few numbers behind {letter}")
            values = [one_number(tokens.pop(0), "d") for _ in range(count)]
            self._go(letter if first else letter.replace("M", "L").replace("m", "l"), values)
            first = False

    def _go(self, letter, values):
        x, y = self._here if letter.islower() else (0.0, 0.0)
        kind = letter.upper()
        if kind == "H":
            self._here = (x + values[0], self._here[1])
        elif kind == "V":
            self._here = (self._here[0], y + values[0])
        else:
            self._here = (x + values[0], y + values[1])
        if kind == "M":
            self.strokes.append([self._here])
        else:
            self.strokes[-1].append(self._here)
