"""A parser of command lines, and types of arguments."""

import argparse
import math
import pathlib
import sys

WRONG_USAGE = 64  # the exit code of all commands of this package
FORMATS = ("svg", "png")  # of pictures


class Parser(argparse.ArgumentParser):
    """Keeps the lines of the epilog, and exits with WRONG_USAGE if the usage is wrong."""

    def __init__(self, **options):
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **options)

    def parse_known_args(self, args=None, namespace=None):
        self._words = sys.argv[1:] if args is None else list(args)
        return super().parse_known_args(args, namespace)

    def error(self, message):
        # argparse looks for what is missing first: an option that doesn't exist would not be named.
        unknown = [word for word in self._words if word.startswith("--") and not any(
            option.startswith(word.partition("=")[0]) for option in self._option_string_actions)]
        if unknown and "required" in message:
            message = f"unrecognized arguments: {' '.join(unknown)}"
        self.print_usage(sys.stderr)
        self.exit(WRONG_USAGE, f"{self.prog}: {message}\n")


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


def not_negative(text):
    value = number(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text}: must be 0 or more")
    return value


def not_zero(text):
    value = number(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"{text}: must not be 0")
    return value


def whole(least, most):
    """A type of whole numbers in a range."""
    def read(text):
        value = number(text)
        if value != int(value) or not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from {least} to {most}")
        return int(value)
    return read


def damping_ratio(text):
    value = not_negative(text)
    if value > 0.9:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0 to 0.9")
    return value
