"""Reads pin traces such as those that the simulated rig and the flight recorder write."""

from .errors import BadTrace, refuse_endless


COILS = ("in1", "in2", "in3", "in4")
# The coils that have current at each half step of a motor of phases.
HALF_STEPS = ((1, 1, 0, 0), (0, 1, 0, 0), (0, 1, 1, 0), (0, 0, 1, 0), (0, 0, 1, 1), (0, 0, 0, 1), (1, 0, 0, 1),
              (1, 0, 0, 0))


class PinTrace:
    """The pins of a VCD file: for each axis and pin, its first level and its edges."""

    def __init__(self, path):
        self.levels = {}  # (axis, pin): first level
        self.edges = {}   # (axis, pin): [(time in ns, level)]
        self.active = {}  # (axis, pin): active level, if the file says it
        self.both_edges = set()  # (axis, pin): each edge is a step
        self._path = path
        self._names = {}
        self._scale = None
        try:
            refuse_endless(path)
            with open(path, encoding="ascii") as file:
                self._read(path, file)
        except (OSError, UnicodeDecodeError) as error:
            raise BadTrace(f"{path}: {error}") from error
        if self._scale is None or not self._names:
            raise BadTrace(f"{path} isn't a VCD file: it has no $timescale, or no $var")

    def axes(self):
        """The names of the axes whose STEP and DIR lines, CW and CCW lines, or IN1 to IN4 all have a level."""
        return [axis for axis, pin in self.levels
                if (pin == "step" and (axis, "dir") in self.levels) or
                (pin == "cw" and (axis, "ccw") in self.levels) or
                (pin == COILS[0] and all((axis, coil) in self.levels for coil in COILS))]

    def counts(self, axis, invert_step=None, invert_dir=None):
        """The times [s] of the steps, and the count after each; each time is later than the one before.
        By default, the levels are those that the file tells; otherwise STEP is inactive at its first
        level, and DIR is inverted if STEP is (common anode inverts both).
        """
        if (axis, "cw") in self.levels:
            return self._counts(axis, self._pulses(axis, "cw", 1, invert_step) +
                                self._pulses(axis, "ccw", -1, invert_dir))
        if (axis, COILS[0]) in self.levels:
            return self._counts(axis, self._patterns(axis))
        active = self.active.get((axis, "step"), not self.levels[axis, "step"])
        if invert_step is not None:
            active = not invert_step
        forward = self.active.get((axis, "dir"), active)
        if invert_dir is not None:
            forward = not invert_dir
        changes = sorted([(time, 0, level) for time, level in self.edges[axis, "dir"]] +
                         [(time, 1, level) for time, level in self.edges[axis, "step"]])
        direction, steps = self.levels[axis, "dir"], []
        for time, is_step, level in changes:
            if not is_step:
                direction = level
            elif level == active or (axis, "step") in self.both_edges:
                steps.append((time, 1 if direction == forward else -1))
        return self._counts(axis, steps)

    def _patterns(self, axis):
        """The times of the steps of a motor whose coils are switched. What comes in between the two writes of a
        kernel counts as well, at the time of the second one."""
        changes = sorted((time, coil, level) for coil in COILS for time, level in self.edges[axis, coil])
        levels = {coil: self.levels[axis, coil] for coil in COILS}
        moves, before = [], self._place(axis, levels)
        for number, (time, coil, level) in enumerate(changes):
            levels[coil] = level
            if number + 1 < len(changes) and changes[number + 1][0] == time:
                continue
            place = self._place(axis, levels)
            if place is None:
                before = before if any(self._is_on(axis, levels)) else None
            elif before not in (None, place):
                moves.append((time, (place - before + 4) % 8 - 4))
            before = before if place is None else place
        full = all(way % 2 == 0 for _, way in moves)
        return [(time, way // 2 if full else way) for time, way in moves]

    def _is_on(self, axis, levels):
        return [int(levels[coil] == self.active.get((axis, coil), True)) for coil in COILS]

    def _place(self, axis, levels):
        on = tuple(self._is_on(axis, levels))
        return HALF_STEPS.index(on) if on in HALF_STEPS else None

    def _pulses(self, axis, pin, way, inverted):
        """The times of the pulses on a line whose steps all go one way."""
        active = self.active.get((axis, pin), not self.levels[axis, pin])
        if inverted is not None:
            active = not inverted
        return [(time, way) for time, level in self.edges[axis, pin] if level == active]

    def _counts(self, axis, steps):
        """The times [s] of steps, and the count after each."""
        count, times, counts = 0, [], []
        for time, way in sorted(steps):
            if times and time * 1e-9 <= times[-1]:
                raise BadTrace(f"{self._path} has two steps of {axis} at {time} ns")
            count += way
            times.append(time * 1e-9)
            counts.append(count)
        return times, counts

    def _read(self, path, file):
        scopes, time = [], None
        for number, line in enumerate(file, 1):
            words = line.split()
            if not words:
                continue
            try:
                if words[0] == "$scope":
                    scopes.append(words[2])
                elif words[0] == "$upscope":
                    scopes.pop()
                elif words[0] == "$timescale":
                    self._scale = scale_of("".join(words[1:-1]))
                elif words[0] == "$var":
                    key = (".".join(scopes), words[4])
                    self._names[words[3]] = key
                    self.edges[key] = []
                elif words[0] == "$comment" and words[2:3] == ["active"] and len(words) == 5:
                    # Other programs' comments say other things.
                    axis, _, pin = words[1].rpartition(".")
                    if words[3] == "both":
                        self.both_edges.add((axis, pin))
                    else:
                        self.active[axis, pin] = words[3] == "high"
                elif words[0].startswith("#"):
                    time = int(words[0][1:]) * self._scale
                    if not 0 <= time < 2**63:
                        raise ValueError("a time of 64 bits")
                elif words[0][0] in "01":
                    self._change(self._names[words[0][1:]], words[0][0] == "1", time)
            except (IndexError, KeyError, TypeError, ValueError) as error:
                raise BadTrace(f"{path}, line {number}: can't be read: {line.strip()}") from error

    def _change(self, key, level, time):
        if key not in self.levels:
            self.levels[key] = level
        elif time is None:
            raise ValueError("an edge before the first time")
        else:
            self.edges[key].append((time, level))


def scale_of(text):
    """A VCD file's unit of time in ns."""
    for unit, size in (("ns", 1), ("us", 1000), ("ms", 10**6)):
        if text.endswith(unit):
            return int(text[:-len(unit)]) * size
    raise ValueError(text)
