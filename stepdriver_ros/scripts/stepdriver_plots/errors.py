"""The reasons why something can't be drawn."""

import pathlib

LONGEST = 500  # characters of a message


class Undrawable(Exception):
    """Says what is wrong, and what was expected, in one line: characters of a file that a terminal
    would obey are shown as escape sequences."""

    def __init__(self, message):
        text = "".join(char if char.isprintable() else ascii(char)[1:-1] for char in message)
        super().__init__(text if len(text) <= LONGEST else text[:LONGEST] + " ...")


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
