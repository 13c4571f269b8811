"""The path that the two axes of a drawing really took, and how far it is from the lines."""


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


def cut_to_lines(path, pulses):
    """Cuts the path into parts of that many pulses each. A part begins where the previous one ended."""
    parts, begin = [], 0
    for count in pulses:
        parts.append(path[begin:begin + count + 1])
        begin += count
    return parts


def offset(place, begin, end):
    """(x, y): a position minus the nearest point of the line between two points."""
    way = (end[0] - begin[0], end[1] - begin[1])
    off = (place[0] - begin[0], place[1] - begin[1])
    square = way[0] ** 2 + way[1] ** 2
    along = 0.0 if square == 0.0 else (off[0] * way[0] + off[1] * way[1]) / square
    along = min(1.0, max(0.0, along))
    return off[0] - along * way[0], off[1] - along * way[1]


def deviations(parts, lines):
    """(x, y): the largest distance in each axis between the positions of a part and its line."""
    offsets = [offset(place, *line) for part, line in zip(parts, lines) for place in part]
    return tuple(max(abs(value) for value in values) for values in zip(*offsets))
