"""Which output of the node draws which stroke: one for all, or those that the colours of an SVG file choose."""

import argparse
from collections import namedtuple

from .errors import BadDrawing

BLACK = "#000000"

Choice = namedtuple("Choice", "colour output")  # a colour of "": all others


def choice(text):
    """An argument: NAME, or COLOUR=NAME with a colour of CSS."""
    colour, equals, output = text.rpartition("=")
    if not output or (equals and not colour):
        raise argparse.ArgumentTypeError(f"{text}: must be NAME or COLOUR=NAME")
    return Choice(hex_of(colour, text) if equals else "", output)


def hex_of(colour, text):
    try:
        import svgelements
    except ImportError as error:
        raise argparse.ArgumentTypeError(f"{text}: colours are read by svgelements: apt install "
                                         f"python3-svgelements ({error})") from error
    value = svgelements.Color(colour.lower())
    found = "" if value.value is None else f"#{value.red:02x}{value.green:02x}{value.blue:02x}"
    # It takes what it doesn't know for black.
    if not found or (found == BLACK and colour.lower() not in ("black", "#000", BLACK)):
        raise argparse.ArgumentTypeError(f"{text}: {colour} isn't a colour; it is #rrggbb or a name such as red")
    return found


class Tools:
    """The outputs that were chosen."""

    def __init__(self, choices):
        self._of_colour = {one.colour: one.output for one in choices}
        if len(self._of_colour) != len(choices):
            raise BadDrawing("an output is given twice for the same strokes")

    @property
    def outputs(self):
        """Each once."""
        return list(dict.fromkeys(self._of_colour.values()))

    @property
    def by_colour(self):
        return any(self._of_colour)

    def of(self, strokes, path):
        """The output of each stroke. path: names the file in errors."""
        missing = {stroke.colour for stroke in strokes} - set(self._of_colour) if "" not in self._of_colour else ()
        if missing:
            colours = ", ".join(sorted(colour or "no colour" for colour in missing))
            raise BadDrawing(f"{path}: has strokes in {colours}, for which no output is given: give one as "
                             "COLOUR=NAME, or one for all others as NAME")
        return [self._of_colour.get(stroke.colour) or self._of_colour[""] for stroke in strokes]


def marks(outputs, of_lines):
    """Where a path switches outputs: (number of the line where it begins, output, whether it is on). All are off at its
    end, and those that don't begin on are switched off at its beginning.

    of_lines: the output that is on along each line; None: no output.
    """
    found = [(0, output, output == of_lines[0]) for output in outputs]
    for number, (before, now) in enumerate(zip(of_lines, of_lines[1:]), 1):
        if before != now:
            found += [(number, output, on) for output, on in ((before, False), (now, True)) if output is not None]
    return found + [(len(of_lines), output, False) for output in outputs]
