"""Reads pin traces such as those that the simulated rig writes."""

from .errors import BadTrace, refuse_endless


class PinTrace:
    """The pins of a VCD file: for each axis and pin, its first level and its edges."""

    def __init__(self, path):
        self.levels = {}  # (axis, pin): first level
        self.edges = {}   # (axis, pin): [(time in ns, level)]
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
        """The names of the axes whose STEP and DIR lines both have a level."""
        return [axis for axis, pin in self.levels
                if pin == "step" and (axis, "dir") in self.levels]

    def counts(self, axis, invert_step=None, invert_dir=None):
        """The times [s] of the steps, and the count after each. By default, STEP is inactive at its
        first level, and DIR is inverted if STEP is (common anode inverts both).
        """
        resting = self.levels[axis, "step"]
        active = not resting if invert_step is None else not invert_step
        forward = (active if invert_dir is None else not invert_dir)
        changes = sorted([(time, 0, level) for time, level in self.edges[axis, "dir"]] +
                         [(time, 1, level) for time, level in self.edges[axis, "step"]])
        direction, count = self.levels[axis, "dir"], 0
        times, counts = [], []
        for time, is_step, level in changes:
            if not is_step:
                direction = level
            elif level == active:
                count += 1 if direction == forward else -1
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
        else:
            self.edges[key].append((time, level))


def scale_of(text):
    """A VCD file's unit of time in ns."""
    for unit, size in (("ns", 1), ("us", 1000), ("ms", 10**6)):
        if text.endswith(unit):
            return int(text[:-len(unit)]) * size
    raise ValueError(text)
