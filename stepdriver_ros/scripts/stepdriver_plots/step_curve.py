"""Position, speed, acceleration and jerk from the times of STEP edges alone.

At each edge the motion crosses a half-step line. The speed between two edges is the distance between
their lines divided by the time, the acceleration is the rate of change of the speed, and so on.
"""

import itertools

REST = 0.1  # [s] without a step means standstill
GAP = float("nan")  # interrupts the line of a graph
JERK_SAMPLES = 250
JUMP = 1.5  # With twice the samples, the jerk at a jump of the acceleration doubles; elsewhere it is the same.


def differences(times, values):
    """The times halfway between samples, and the rates of change at those times."""
    at, rates = [], []
    for a, b, v, w in zip(times, times[1:], values, values[1:]):
        # Far from 0, times that are only nanoseconds apart can be the same number.
        if b > a:
            at.append((a + b) / 2)
            rates.append((w - v) / (b - a))
    return at, rates


class StepCurve:
    """One axis: the half-step line that it crosses at each edge."""

    def __init__(self, times, places, label="", unit="steps", step=1.0):
        """times [s] of the edges; places in the unit; step: the size of a microstep in the unit."""
        self.times = times
        self.places = places
        self.label = label
        self.unit = unit
        self.step = step
        self.stands = places  # The positions at which it may come to rest.
        self._motions = None  # Numbers of the edges of each motion, if they don't follow from the times.

    samples = "pulses"

    @classmethod
    def of_counts(cls, times, counts, label="", unit="steps", step=1.0, first=0):
        """From the count after each edge. first: the count before the first edge."""
        places = [(before + count) / 2 * step for before, count in zip([first] + counts, counts)]
        curve = cls(times, places, label, unit, step)
        curve.stands = [count * step for count in [first] + counts]
        return curve

    @property
    def has_jerk_limit(self):
        """If the acceleration jumps, the jerk that is found there rises with the number of samples."""
        fine, rough = (max((abs(value) for value in self.coarse(samples).jerk()[1] if value == value), default=0.0)
                       for samples in (JERK_SAMPLES, JERK_SAMPLES // 2))
        return 0.0 < fine < JUMP * rough

    def coarse(self, samples):
        """The same curve from only about this many edges of each motion. That removes the noise that whole
        nanoseconds cause in differences of differences."""
        thinned = [self._thinned(s, (self.times[s[-1]] - self.times[s[0]]) / samples) for s in self._stretches()]
        kept = list(itertools.chain.from_iterable(thinned))
        curve = StepCurve([self.times[i] for i in kept], [self.places[i] for i in kept],
                          self.label, self.unit, self.step)
        ends = list(itertools.accumulate((len(stretch) for stretch in thinned), initial=0))
        curve._motions = [list(range(begin, end)) for begin, end in zip(ends, ends[1:])]
        return curve

    def _stretches(self):
        """The edges of each motion between rests."""
        if self._motions is not None:
            return self._motions
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
        """The derivative of each motion between two rests, with a gap at each standstill."""
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
            else:  # standstill: interrupts the line of the graph
                at.append(place)
                values.append(GAP)
        return at, values
