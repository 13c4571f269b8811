"""The path that the two axes of a drawing really took, and how far it is from the lines."""

import math


def path_of_pulses(start, steps, unit_steps):
    """Positions after each pulse of either axis.

    start: their positions before the first pulse; steps: for each axis the times and the counts,
    which begin one step from the start; unit_steps: the size of a microstep of each axis.
    """
    events = []
    for axis, (times, counts) in enumerate(steps):
        events += [(time, axis, count) for time, count in zip(times, counts)]
    place, path = list(start), [tuple(start)]
    for _, axis, count in sorted(events):
        place[axis] = start[axis] + count * unit_steps[axis]
        path.append(tuple(place))
    return path


def offset(place, begin, end):
    """(x, y): a position minus the nearest point of the line between two points."""
    way = (end[0] - begin[0], end[1] - begin[1])
    off = (place[0] - begin[0], place[1] - begin[1])
    square = way[0] ** 2 + way[1] ** 2
    along = 0.0 if square == 0.0 else (off[0] * way[0] + off[1] * way[1]) / square
    along = min(1.0, max(0.0, along))
    return off[0] - along * way[0], off[1] - along * way[1]


class Follower:
    """Finds the line that a path follows, place by place: a path leaves a line only near its end."""

    def __init__(self, lines, near):
        """lines: (begin, end) of each; near: how far from the end of a line the path may leave it."""
        self._lines = lines
        self._near = near
        self._candidates = [0]  # the numbers of the lines that it may follow

    def follow(self, place):
        """The number of the nearest of these lines, and the offset from it."""
        number = self._candidates[-1]
        while number + 1 < len(self._lines) and math.dist(place, self._lines[number][1]) <= self._near:
            number += 1
            self._candidates.append(number)
        offsets = {number: offset(place, *self._lines[number]) for number in self._candidates}
        distances = {number: math.hypot(*off) for number, off in offsets.items()}
        nearest = min(distances, key=lambda number: (distances[number], number))
        self._candidates = [number for number in self._candidates
                            if distances[number] <= max(self._near, distances[nearest])]
        return nearest, offsets[nearest]


def along(path, lines, near):
    """The numbers of the lines that each position of a path follows, and (x, y): the largest distance in
    each axis between a position and its line."""
    follower = Follower(lines, near)
    numbers, offsets = zip(*(follower.follow(place) for place in path))
    return numbers, tuple(max(abs(value) for value in values) for values in zip(*offsets))


def parts(path, flags):
    """Cuts a path where the flag of its positions changes: (positions, flag) for each part. A part begins
    where the previous one ended."""
    cut, begin = [], 0
    for index in range(1, len(path) + 1):
        if index == len(path) or flags[index] != flags[begin]:
            cut.append((path[max(0, begin - 1):index], flags[begin]))
            begin = index
    return cut
