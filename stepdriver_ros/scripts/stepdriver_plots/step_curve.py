"""Position, speed, acceleration and jerk from the times of STEP edges alone.

At each edge the motion is on a half-step line; the speed between two edges is the way from line to
line over the time, the acceleration the change from one speed to the next, and so on.
"""

REST = 0.1  # [s] without a step: it stands
GAP = float("nan")  # breaks off the line of a graph


def differences(times, values):
    """Times between the samples, and the rates of change there."""
    at = [(a + b) / 2 for a, b in zip(times, times[1:])]
    changes = zip(times, times[1:], values, values[1:])
    return at, [(w - v) / (b - a) for a, b, v, w in changes]


class StepCurve:
    """One axis: where it is on the half-step lines that its edges were at."""

    def __init__(self, times, places, label="", unit="steps", step=1.0):
        """times [s] of the edges, places in the unit; step: the unit's way of one of them."""
        self.times = times
        self.places = places
        self.label = label
        self.unit = unit
        self.step = step

    @classmethod
    def of_counts(cls, times, counts, label="", unit="steps", step=1.0):
        """From the count after each edge; before the first one it was 0."""
        places = [(before + count) / 2 * step for before, count in zip([0] + counts, counts)]
        return cls(times, places, label, unit, step)

    has_jerk_limit = True  # as far as edges tell

    def coarse(self, samples):
        """The same from fewer of the edges, about so many: what is noise from one nanosecond to
        the next in differences of differences, isn't there."""
        stretches = self._stretches()
        window = sum(self.times[s[-1]] - self.times[s[0]] for s in stretches) / samples
        kept = [i for stretch in stretches for i in self._thinned(stretch, window)]
        return StepCurve([self.times[i] for i in kept], [self.places[i] for i in kept],
                         self.label, self.unit, self.step)

    def _stretches(self):
        """The edges of each motion between rests."""
        stretches = []
        for i, time in enumerate(self.times):
            if i == 0 or time - self.times[i - 1] > REST:
                stretches.append([])
            stretches[-1].append(i)
        return stretches

    def _thinned(self, stretch, window):
        kept = stretch[:1]
        for i in stretch[1:]:
            if self.times[i] - self.times[kept[-1]] >= window:
                kept.append(i)
        last = stretch[-1]
        if kept[-1] != last:
            if len(kept) > 1 and self.times[last] - self.times[kept[-1]] < window / 2:
                kept.pop()
            kept.append(last)
        return kept

    def position(self):
        return self.times, self.places

    def speed(self):
        at, speeds = [], []
        for before, time, here, place in zip(self.times, self.times[1:],
                                             self.places, self.places[1:]):
            gap = time - before
            if gap > REST:
                at += [before + REST / 4, time - REST / 4]
                speeds += [0.0, 0.0]
            else:
                at.append((time + before) / 2)
                speeds.append((place - here) / gap)
        return at, speeds

    def acceleration(self):
        return self._of_each_motion(lambda times, places: differences(*differences(times, places)))

    def jerk(self):
        return self._of_each_motion(
            lambda times, places: differences(*differences(*differences(times, places))))

    def _of_each_motion(self, derivative):
        """Of each motion between two rests for itself: there is none over a standstill."""
        at, values = [], []
        for stretch in self._stretches():
            own_at, own_values = derivative([self.times[i] for i in stretch],
                                            [self.places[i] for i in stretch])
            if at and own_at:
                at.append(own_at[0])
                values.append(GAP)
            at += own_at
            values += own_values
        return at, values

    def speed_over_position(self):
        return self._over_position(lambda way, gap: way / gap)

    def period_over_position(self):
        """[us] from step to step."""
        return self._over_position(lambda _, gap: gap * 1e6)

    def _over_position(self, value):
        at, values = [], []
        for before, time, here, place in zip(self.times, self.times[1:],
                                             self.places, self.places[1:]):
            if time - before <= REST:
                at.append((here + place) / 2)
                values.append(value(place - here, time - before))
            else:  # it stands: the line of the graph breaks off
                at.append(place)
                values.append(GAP)
        return at, values
