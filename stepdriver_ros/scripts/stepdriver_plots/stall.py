"""The threshold at which a driver chip reports a stall, from the load that it has measured without one, and
how well homings to a stall repeat. SG_RESULT falls as the load rises; at or below twice the threshold it is
a stall. On SPI the threshold (SGT) shifts SG_RESULT, and 0 is a stall."""

import math
from collections import namedtuple

Sample = namedtuple("Sample", "position velocity load")  # SI, and SG_RESULT

FEWEST = 10  # samples of each direction at the constant speed
AT_SPEED = 0.999  # a slower sample is one of a ramp
SETTLING = 4  # [full steps] at a constant speed until the chip has measured the load there
HALF = 0.5  # of the lowest SG_RESULT without a stall is one
PER_UNIT = 2  # of SG_RESULT in one of the threshold
# On SPI, SG_RESULT without a load is at least this if it is 0 at a stall: the two differ by so much at least
# (TMC2130 datasheet rev. 1.09, section 14.3).
FREE = 100
SGT = (-64, 63)  # from the most sensitive threshold on SPI to the least
CYCLE = 1024  # of MSCNT, in 4 full steps
CYCLE_STEPS = 4


def at_speed(samples, speed, full_step):
    """The samples of one direction that were taken at the constant speed, after the chip has settled."""
    fast = [sample for sample in samples if abs(sample.velocity) >= AT_SPEED * speed]
    if not fast:
        return []
    begin = fast[0].position
    return [sample for sample in fast[1:] if abs(sample.position - begin) >= SETTLING * full_step]


def threshold_of(samples):
    """Of these samples without a stall; None if the load leaves no room for one."""
    return int(min(sample.load for sample in samples) * HALF / PER_UNIT) or None


def most_sensitive(lowest_load):
    """The threshold on SPI; None if the load leaves no room for one. lowest_load(threshold): the lowest SG_RESULT
    without a stall, which rises with the threshold."""
    low, high = SGT
    if lowest_load(high) < FREE:
        return None
    while low < high:
        middle = (low + high) // 2
        if lowest_load(middle) < FREE:
            low = middle + 1
        else:
            high = middle
    return high


def middle_of(phases):
    """The middle of places in the electrical cycle, and how far the outermost ones are apart."""
    reference = math.atan2(sum(math.sin(2.0 * math.pi * phase / CYCLE) for phase in phases),
                           sum(math.cos(2.0 * math.pi * phase / CYCLE) for phase in phases))
    near = round(reference / (2.0 * math.pi) * CYCLE)
    away = [(phase - near + CYCLE // 2) % CYCLE - CYCLE // 2 for phase in phases]
    return round(near + (min(away) + max(away)) / 2.0) % CYCLE, max(away) - min(away)


def places_of(shifts):
    """Where homings ended, relative to the first one. shifts: how far each was from the one before."""
    places = [0.0]
    for shift in shifts:
        places.append(places[-1] + shift)
    return places
