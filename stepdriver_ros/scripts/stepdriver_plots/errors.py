"""Why something can't be drawn."""


class Undrawable(Exception):
    """Says what is wrong, and what was to be expected."""


class BadTrace(Undrawable):
    """The file can't be read as a pin trace."""


class BadDrawing(Undrawable):
    """What is to be drawn can't be."""


class NodeError(Undrawable):
    """The node isn't there, or refuses."""
