"""The reasons why something can't be drawn."""

import pathlib


class Undrawable(Exception):
    """Says what is wrong, and what was expected."""


def refuse_endless(path):
    """Refuses devices and pipes: reading them might never end."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise Undrawable(f"{path}: isn't a file")


class BadTrace(Undrawable):
    """The file can't be read as a pin trace."""


class BadDrawing(Undrawable):
    """The drawing can't be read, or can't be drawn with these axes."""


class NodeError(Undrawable):
    """The node can't be reached, or refuses a request."""
