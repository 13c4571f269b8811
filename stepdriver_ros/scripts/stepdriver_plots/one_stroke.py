"""Turns a drawing into one stroke, for a pen that can't be lifted."""

import heapq
import itertools
import math
from collections import defaultdict, namedtuple

from .errors import BadDrawing


class OneStroke(namedtuple("OneStroke", "stroke length twice added")):
    """Points, and [mm] the length of the stroke, how much of that is drawn twice, and how much joins
    parts of the drawing that don't touch."""

    def text(self):
        more = [f"{length:.0f} mm {what}" for length, what in (
            (self.twice, "are drawn twice"), (self.added, "join parts that don't touch"))
                if round(length) > 0]
        return f"one stroke of {self.length:.0f} mm{': ' if more else ''}{' and '.join(more)}"


# Points that are closer than this part of the drawing's size count as one. Points of an SVG file have rounding
# errors of up to 3e-6 of its page, if they are stroked with a transform.
SAME = 1e-5


def one_stroke(strokes, start):
    """Follows every line once, and some lines twice if there is no other way to continue. Parts that
    don't touch are joined by the shortest lines between their points. The length that is drawn twice
    is kept short, but isn't always the minimum.

    start: position of the pen; the stroke begins as near to it as possible.
    """
    graph = Graph(strokes)
    added = graph.join_parts()
    whole = graph.length()
    twice = graph.double_between_odd(start)
    stroke = graph.walk(start)
    return OneStroke(stroke, whole + twice, twice, added)


class Graph:
    """Points, and how often each line between two of them has to be drawn."""

    def __init__(self, strokes):
        points = [point for stroke in strokes for point in stroke]
        size = max(max(values) - min(values) for values in zip(*points))
        self._grid = SAME * (size or 1.0)
        self._places = {}  # position of each point of the grid
        self._lines = defaultdict(lambda: defaultdict(int))  # [from][to]: how often
        for stroke in strokes:
            nodes = [self._node(point) for point in stroke]
            if len(nodes) == 1:
                self._lines[nodes[0]]  # a dot
            for here, there in zip(nodes, nodes[1:]):
                if here != there and there not in self._lines[here]:
                    self._add(here, there)
        if not self._lines:
            raise BadDrawing("one stroke can't follow lines that are all shorter than "
                             f"{self._grid:.6g} mm, 1e-5 of the drawing's size")

    def _node(self, point):
        column, row = (round(value / self._grid) for value in point)
        cells = [(column + i, row + j) for i, j in itertools.product((0, -1, 1), repeat=2)]
        for node in cells:
            if node in self._places and math.dist(point, self._places[node]) <= self._grid:
                return node
        self._places.setdefault(cells[0], point)
        return cells[0]

    def _add(self, here, there):
        self._lines[here][there] += 1
        self._lines[there][here] += 1

    def _distance(self, here, there):
        return math.dist(self._places[here], self._places[there])

    def length(self):
        return sum(count * self._distance(here, there) for here, ends in self._lines.items()
                   for there, count in ends.items()) / 2

    def _parts(self):
        """The nodes of each connected part."""
        parts, seen = [], set()
        for first in self._lines:
            if first in seen:
                continue
            part, left = [], [first]
            seen.add(first)
            while left:
                node = left.pop()
                part.append(node)
                for other in self._lines[node]:
                    if other not in seen:
                        seen.add(other)
                        left.append(other)
            parts.append(part)
        return parts

    def join_parts(self):
        """Joins all parts, and returns the length of the lines that join them."""
        joined, *parts = self._parts()
        part_of = {node: part for part in parts for node in part}
        nearest = {node: (math.inf, node) for node in part_of}  # among the nodes joined so far
        added = 0.0
        while nearest:
            for node, (distance, _) in nearest.items():
                closest = min(joined, key=lambda other, node=node: self._distance(node, other))
                nearest[node] = min((distance, nearest[node][1]),
                                    (self._distance(node, closest), closest))
            there = min(nearest, key=lambda node: nearest[node][0])
            distance, here = nearest[there]
            self._add(here, there)
            added += distance
            joined = part_of[there]
            for node in joined:
                del nearest[node]
        return added

    def _odd(self):
        return [node for node, ends in self._lines.items() if sum(ends.values()) % 2]

    def double_between_odd(self, start):
        """A stroke must begin or end at each point with an odd number of lines. Draws lines twice to
        pair all but two of these points, and returns the length of those lines."""
        odd = self._odd()
        if len(odd) <= 2:
            return 0.0
        odd.remove(self._nearest(odd, start))
        ways = sorted((length, odd[i], other, route) for i in range(len(odd))
                      for other, length, route in self._shortest(odd[i], set(odd[i + 1:])))
        free, twice = set(odd), 0.0
        for length, here, there, route in ways:
            if len(free) < 3:
                break
            if here in free and there in free:
                free -= {here, there}
                twice += length
                for a, b in zip(route, route[1:]):
                    self._add(a, b)
        return twice

    def _nearest(self, nodes, place):
        return min(nodes, key=lambda node: math.dist(self._places[node], place))

    def _shortest(self, begin, wanted):
        """Yields (node, length, the nodes on the way) for each wanted node."""
        lengths, before, left = {begin: 0.0}, {}, [(0.0, begin)]
        while left and wanted:
            length, node = heapq.heappop(left)
            if length > lengths[node]:
                continue
            if node in wanted:
                wanted.remove(node)
                route = [node]
                while route[-1] != begin:
                    route.append(before[route[-1]])
                yield node, length, route
            for other in self._lines[node]:
                further = length + self._distance(node, other)
                if further < lengths.get(other, math.inf):
                    lengths[other], before[other] = further, node
                    heapq.heappush(left, (further, other))

    def walk(self, start):
        """All lines in one stroke, by Hierholzer's algorithm."""
        odd = self._odd()
        node = self._nearest(odd or list(self._lines), start)
        path, stroke = [node], []
        while path:
            ends = self._lines[path[-1]]
            if ends:
                there = next(iter(ends))
                for a, b in ((path[-1], there), (there, path[-1])):
                    self._lines[a][b] -= 1
                    if self._lines[a][b] == 0:
                        del self._lines[a][b]
                path.append(there)
            else:
                stroke.append(self._places[path.pop()])
        return stroke[::-1]
