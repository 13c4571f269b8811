"""Finding what rings on a machine: oscillations of an axis, what an accelerometer shows of them, and the
input shapers that stop it. The formulas of the shapers are those of profile/input_shaper.h."""

import cmath
import math
from collections import namedtuple

Point = namedtuple("Point", "time position velocity")
Peak = namedtuple("Peak", "frequency damping response")
Shaper = namedtuple("Shaper", "name parts delays")

POINTS = 12  # points of a trajectory in each period
RAMP = 3  # periods in which an oscillation rises, and falls again
ALLOWED = 0.05  # part of the oscillation that EI and 2HUMP_EI, and a proposal, may leave
UNKNOWN_DAMPING = 0.1


def oscillation(frequency, amplitude, seconds):
    """A trajectory around 0: it rises within RAMP periods to this amplitude, and falls again at its end.
    Its acceleration is at most amplitude (2 pi frequency)^2."""
    periods = max(2 * RAMP + 2, round(seconds * frequency))
    w = 2.0 * math.pi * frequency
    points = []
    for i in range(1, periods * POINTS + 1):
        t = i / POINTS / frequency
        part, slope = envelope(i / POINTS, periods)
        points.append(Point(t, amplitude * part * math.sin(w * t),
                            amplitude * (part * w * math.cos(w * t)
                                         + slope * frequency * math.sin(w * t))))
    return points


def envelope(period, periods):
    """The part of the amplitude, and its change in a period."""
    rising = min(period, periods - period) / RAMP
    if rising >= 1.0:
        return 1.0, 0.0
    slope = 6.0 * rising * (1.0 - rising) / RAMP
    return rising * rising * (3.0 - 2.0 * rising), slope if period < periods - period else -slope


def largest_amplitude(frequency, speed, acceleration, jerk):
    """Of an oscillation within these limits. jerk: 0 if there is no limit."""
    w = 2.0 * math.pi * frequency
    bounds = [speed / w, acceleration / w ** 2]
    if jerk > 0.0:
        bounds.append(jerk / w ** 3)
    return min(bounds)


def amplitude_at(frequency, times, values):
    """The amplitude of the oscillation at this frequency in samples, which may be irregular: the least
    squares of a constant and a sine."""
    w = 2.0 * math.pi * frequency
    middle = sum(values) / len(values)
    cc = cs = ss = vc = vs = 0.0
    for t, value in zip(times, values):
        c, s = math.cos(w * (t - times[0])), math.sin(w * (t - times[0]))
        v = value - middle
        cc, cs, ss, vc, vs = cc + c * c, cs + c * s, ss + s * s, vc + v * c, vs + v * s
    det = cc * ss - cs * cs
    if det <= 0.0:
        return 0.0
    return math.hypot((vc * ss - vs * cs) / det, (vs * cc - vc * cs) / det)


def peaks_of(frequencies, responses):
    """The peaks that are at least half as high as the highest one, the highest first. Their damping is that
    of an oscillator with the same width at 1/sqrt(2) of the height."""
    peaks = []
    least = max(responses) / 2.0
    for i in range(1, len(responses) - 1):
        here = responses[i]
        if here < least or here < responses[i - 1] or here <= responses[i + 1]:
            continue
        level = here / math.sqrt(2.0)
        low = crossing(frequencies, responses, i, -1, level)
        high = crossing(frequencies, responses, i, 1, level)
        place = summit(frequencies[i - 1:i + 2], responses[i - 1:i + 2])
        damping = UNKNOWN_DAMPING
        if low is not None and high is not None:
            damping = min((high - low) / (2.0 * place), 0.9)
        peaks.append(Peak(place, damping, here))
    return sorted(peaks, key=lambda peak: -peak.response)


def crossing(frequencies, responses, begin, step, level):
    """Where the responses fall below a level, from an index on; None: nowhere."""
    i = begin
    while 0 <= i + step < len(responses):
        if responses[i + step] < level:
            part = (responses[i] - level) / (responses[i] - responses[i + step])
            return frequencies[i] + part * (frequencies[i + step] - frequencies[i])
        i += step
    return None


def summit(xs, ys):
    """The highest place of the parabola through three points."""
    (a, b, c), (u, v, w) = xs, ys
    left, right = (v - u) / (b - a), (w - v) / (c - b)
    if left == right:
        return b
    return (a + b) / 2.0 + left * (c - a) / (2.0 * (left - right))


def shapers(frequency, damping):
    """Each shaper for this oscillation, the shortest first."""
    root = math.sqrt(1.0 - damping * damping)
    period = 1.0 / (frequency * root)

    def shaper(name, *impulses):
        parts = [part * math.exp(-2.0 * math.pi * damping / root * at) for part, at in impulses]
        return Shaper(name, [part / sum(parts) for part in parts],
                      [at * period for _, at in impulses])

    outer, inner = 1.0 - math.sqrt(0.5), math.sqrt(2.0) - 1.0
    square = ALLOWED ** 2
    x = (square * (math.sqrt(1.0 - square) + 1.0)) ** (1.0 / 3.0)
    hump = (3.0 * x * x + 2.0 * x + 3.0 * square) / (16.0 * x)
    return [shaper("zv", (1.0, 0.0), (1.0, 0.5)),
            shaper("mzv", (outer, 0.0), (inner, 0.375), (outer, 0.75)),
            shaper("ei", ((1.0 + ALLOWED) / 4.0, 0.0), ((1.0 - ALLOWED) / 2.0, 0.5),
                   ((1.0 + ALLOWED) / 4.0, 1.0)),
            shaper("2hump_ei", (hump, 0.0), (0.5 - hump, 0.5), (0.5 - hump, 1.0), (hump, 1.5))]


def left_by(shaper, frequency, damping):
    """The part of an oscillation that is left after a shaper."""
    w = 2.0 * math.pi * frequency
    pole = complex(-damping, math.sqrt(1.0 - damping * damping)) * w
    end = shaper.delays[-1]
    return abs(sum(part * cmath.exp(pole * (end - delay))
                   for part, delay in zip(shaper.parts, shaper.delays)))


def proposal(frequencies, responses, peak):
    """The shortest shaper for a peak that leaves at most ALLOWED of what was measured around it, and that
    part; the longest one if none does."""
    near = [(f, r) for f, r in zip(frequencies, responses)
            if r >= peak.response / 2.0 and abs(f - peak.frequency) <= 0.25 * peak.frequency]
    total = math.sqrt(sum(r * r for _, r in near))
    for shaper in shapers(peak.frequency, peak.damping):
        left = math.sqrt(sum((left_by(shaper, f, peak.damping) * r) ** 2 for f, r in near)) / total
        if left <= ALLOWED:
            break
    return shaper, left
