"""Why something can't be drawn."""

import pathlib


class Undrawable(Exception):
    """Says what is wrong, and what was to be expected."""


def refuse_endless(path):
    """Devices and pipes have no end that a reader could wait for."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise Undrawable(f"{path}: isn't a file")


class BadTrace(Undrawable):
    """The file can't be read as a pin trace."""


class BadDrawing(Undrawable):
    """What is to be drawn can't be."""


class NodeError(Undrawable):
    """The node isn't there, or refuses."""
