"""Where the two axes of a drawing have really been, and how far that is from its lines."""


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


def offset(place, begin, end):
    """(x, y) from the nearest point of a line between two points to a place."""
    way = (end[0] - begin[0], end[1] - begin[1])
    off = (place[0] - begin[0], place[1] - begin[1])
    square = way[0] ** 2 + way[1] ** 2
    along = 0.0 if square == 0.0 else (off[0] * way[0] + off[1] * way[1]) / square
    along = min(1.0, max(0.0, along))
    return off[0] - along * way[0], off[1] - along * way[1]


def deviations(parts, lines):
    """(x, y): how far in each axis the places of a part are off its line at most."""
    offsets = [offset(place, *line) for part, line in zip(parts, lines) for place in part]
    return tuple(max(abs(value) for value in values) for values in zip(*offsets))
