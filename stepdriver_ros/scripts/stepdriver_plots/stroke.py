"""A stroke of a drawing."""


class Stroke(list):
    """Points (x, y), of which one alone is a dot, and the colour in which they are drawn: "#rrggbb", or "" if that
    isn't known."""

    def __init__(self, points=(), colour=""):
        super().__init__(points)
        self.colour = colour

    def at(self, points):
        """The same stroke elsewhere."""
        return Stroke(points, self.colour)
