"""Where the two axes of a drawing have really been, and how far that is from its lines."""

import math


def path_of_pulses(start, steps, unit_steps):
    """Places after each pulse of either axis.

    start: where both were; steps: of each axis the times and the counts, of which the first is one
    off the start; unit_steps: the way of a microstep of each.
    """
    events = []
    for axis, (times, counts) in enumerate(steps):
        events += [(time, axis, count) for time, count in zip(times, counts)]
    place, path = list(start), [tuple(start)]
    for _, axis, count in sorted(events):
        place[axis] = start[axis] + count * unit_steps[axis]
        path.append(tuple(place))
    return path


def cut_to_lines(path, pulses):
    """The parts of the path, of as many pulses each; a part begins where the last one ended."""
    parts, begin = [], 0
    for count in pulses:
        parts.append(path[begin:begin + count + 1])
        begin += count
    return parts


def distance(place, begin, end):
    """From a place to a line between two points."""
    way = (end[0] - begin[0], end[1] - begin[1])
    off = (place[0] - begin[0], place[1] - begin[1])
    square = way[0] ** 2 + way[1] ** 2
    along = 0.0 if square == 0.0 else (off[0] * way[0] + off[1] * way[1]) / square
    along = min(1.0, max(0.0, along))
    return math.hypot(off[0] - along * way[0], off[1] - along * way[1])


def farthest(path, lines):
    """The greatest distance of a place from the nearest of the lines."""
    return max(min(distance(place, begin, end) for begin, end in lines) for place in path)
