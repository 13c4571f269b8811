"""Kinds of arguments on a command line."""

import argparse
import math
import pathlib

from .figure import FORMATS


def picture(text):
    path = pathlib.Path(text)
    if path.suffix[1:] not in FORMATS:
        raise argparse.ArgumentTypeError(f"{text}: the name must end in "
                                         f"{' or '.join('.' + f for f in FORMATS)}")
    return path


def number(text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text}: must be a finite number")
    return value


def positive(text):
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value
