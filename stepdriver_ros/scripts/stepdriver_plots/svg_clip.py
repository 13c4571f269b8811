"""Cuts lines at the edges of what clips them, with shapely."""

import math

from .errors import BadDrawing


class Region:
    """An area that clips lines. It includes its edges."""

    def __init__(self, rings, even_odd, margin):
        """rings: closed lines; even_odd: the rule by which they enclose the area, otherwise nonzero; margin:
        the area is this much larger, because points have rounding errors."""
        try:
            from shapely.geometry import LineString
            from shapely.ops import polygonize, unary_union
            from shapely.prepared import prep
        except ImportError as error:
            raise BadDrawing("the drawing is clipped, and lines are cut by shapely: apt install "
                             f"python3-shapely ({error})") from error
        self._line = LineString
        rings = [ring + ring[:1] for ring in rings if len(set(ring)) > 2]
        faces = polygonize(unary_union([LineString(ring) for ring in rings]))
        inside = [face for face in faces
                  if is_inside(turns(face.representative_point().coords[0], rings), even_odd)]
        self._area = unary_union(inside).buffer(margin)
        self._prepared = prep(self._area)

    def cut(self, stroke):
        """The parts of a stroke in the area, in its order. A stroke of one point is a dot."""
        if self._prepared.covers(self._line(stroke if len(stroke) > 1 else stroke * 2)):
            return [stroke]
        parts = []
        for begin, end in zip(stroke, stroke[1:]):
            for part in self._pieces(begin, end):
                if parts and parts[-1][-1] == part[0]:
                    parts[-1].append(part[1])
                else:
                    parts.append(part)
        return parts

    def _pieces(self, begin, end):
        """The parts of a line in the area."""
        line = self._line([begin, end])
        if self._prepared.covers(line):
            return [[begin, end]]
        common = line.intersection(self._area)
        pieces = [sorted(piece.coords, key=lambda place: math.dist(begin, place))
                  for piece in getattr(common, "geoms", [common]) if piece.length > 0.0]
        return sorted(([piece[0], piece[-1]] for piece in pieces),
                      key=lambda piece: math.dist(begin, piece[0]))


def is_inside(winding, even_odd):
    return winding % 2 != 0 if even_odd else winding != 0


def turns(place, rings):
    """How often closed lines go around a point."""
    x, y = place
    count = 0
    for ring in rings:
        for (ax, ay), (bx, by) in zip(ring, ring[1:]):
            if (ay <= y) != (by <= y):
                left = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
                if (by > ay) == (left > 0.0):
                    count += 1 if by > ay else -1
    return count
