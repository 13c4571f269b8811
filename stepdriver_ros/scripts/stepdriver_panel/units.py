"""The units of the page: mm and degrees, as in configurations. The driver's are m and rad."""

import math
import re

UNITS = {"m": (1000.0, "mm"), "rad": (180.0 / math.pi, "deg")}
SHOWN_AS_ZERO = 0.5e-4
# A number, its unit, and what it is per: nothing for a position, "/s" for a speed.
QUANTITY = re.compile(r"(?<![A-Za-z0-9_.])(-?[0-9]+(?:[.][0-9]+)?(?:e[-+]?[0-9]+)?) (m|rad)((?:/s(?:\^[0-9])?)?)"
                      r"(?![A-Za-z0-9_/^])")


def position_text(value, unit):
    return f"{0.0 if abs(value) < SHOWN_AS_ZERO else value:.4f} {unit}"


def rounded_text(number):
    """Six digits, and a whole number from 100000 on."""
    return f"{number:.6g}" if abs(number) < 1e5 or abs(number) > 9e15 else f"{number:.0f}"


def in_page_units(text):
    """A text of the driver with its quantities in mm and degrees."""
    def converted(match):
        factor, unit = UNITS[match[2]]
        value = float(match[1]) * factor
        return f"{rounded_text(value)} {unit}{match[3]}" if match[3] else position_text(value, unit)
    return QUANTITY.sub(converted, text)
