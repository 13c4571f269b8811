"""A mass that an axis pulls along by a spring: what rings after a motion."""

import cmath
import math

AFTER = 6  # periods to show after the motion
SAMPLES = 40  # in each period


def deflection(curve, frequency, damping):
    """How far the mass is ahead of the axis: times [s] and values in the curve's unit, from the beginning
    of the motion until some periods after its end.

    curve: a PlanCurve. frequency [Hz], damping: the damping ratio. With u the deflection and p the
    position of the axis, u'' + 2 d w u' + w^2 u = -p'', solved in closed form for each piece.
    """
    w = 2.0 * math.pi * frequency
    pole = complex(-damping, math.sqrt(1.0 - damping * damping)) * w
    times, values = [0.0], [0.0]
    u, rate, before = 0.0, 0.0, 0.0  # before: the velocity of the axis
    rest = (AFTER / frequency, 0.0, 0.0, 0.0)
    pieces = [(p.duration, p.velocity, p.acceleration, p.jerk) for p in curve.pieces] + [rest]
    start = 0.0
    for duration, velocity, acceleration, jerk in pieces:
        rate -= velocity - before
        # What the acceleration alone would do: c0 + c1 t.
        c1 = -jerk / w ** 2
        c0 = -(acceleration + 2.0 * damping * w * c1) / w ** 2
        # The rest is the real part of z exp(pole t).
        own, own_rate = u - c0, rate - c1
        z = complex(own, (pole.real * own - own_rate) / pole.imag)
        samples = max(2, math.ceil(duration * frequency * SAMPLES))
        for i in range(1, samples + 1):
            t = duration * i / samples
            turned = z * cmath.exp(pole * t)
            u, rate = c0 + c1 * t + turned.real, c1 + (turned * pole).real
            times.append(start + t)
            values.append(u)
        before = velocity + duration * (acceleration + duration * jerk / 2)
        start += duration
    return times, values


def ringing(curve, frequency, damping):
    """The largest deflection after the motion, in the curve's unit."""
    end = curve.starts[-1]
    times, values = deflection(curve, frequency, damping)
    return max(abs(u) for t, u in zip(times, values) if t >= end)
