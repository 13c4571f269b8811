#!/usr/bin/env python3
"""Gives random files to the readers of draw and plot_motion, as libFuzzer does to those in C++.

usage: readers_fuzz.py drawing|recording [--seconds S | --runs N] [--seed N] [--kept FOLDER]
           [--found PREFIX] FILE_OR_FOLDER...

drawing: SVG files and lists of points; recording: pin traces and bags. The inputs begin with the given
files. One that reaches a new line of the readers is kept, and changed again. Each must be read, or refused
with a message of one line, within 20 s of processor time and 2 GB. With --runs, the same seed and files give
the same N inputs, if PYTHONHASHSEED is set.

Exit code 0: nothing was found.
"""

import argparse
import hashlib
import importlib.machinery
import importlib.util
import math
import pathlib
import random
import resource
import signal
import sys
import tempfile
import time
import traceback

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "stepdriver_ros/scripts"
sys.path.insert(0, str(SCRIPTS))
from stepdriver_plots import drawing, one_stroke  # noqa: E402: the path comes first
from stepdriver_plots.errors import Undrawable  # noqa: E402

LONGEST = 20  # [s] of processor time, for one input
MEMORY = 2 << 30  # [bytes]
LARGEST = 20000  # bytes of an input
LIMITS = ((0.0, 200.0), (-50.0, 50.0))  # [mm] of the axes
WORDS = [b"0", b"-1", b"1e308", b"1e-320", b"-1e308", b"nan", b"inf", b"9223372036854775807", b"#", b"%",
         b"M", b"Z", b"A", b"a 1 1 0 0 1 ", b"C", b"q", b"<g>", b"</g>", b"scale(0)", b"rotate(1e308)",
         b"matrix(", b"<use href='#a'/>", b"id='a' ", b"<svg ", b"viewBox='0 0 0 0' ", b"width='1in' ",
         b"clip-path='url(#a)' ", b"<clipPath ", b"mask='url(#e)' ", b"style='fill:none' ", b"<image href='a' ",
         b"\n", b" ", b"$scope module ", b"$upscope $end\n", b"$timescale 1 ms $end\n", b"$var wire 1 a step $end\n",
         b"#0\n", b"1a\n", b"0a\n", b"0b\n", b"1b\n", b"\x00\x00\x00\x00", b"\xff\xff\xff\xff", b"op=\x07",
         b"chunk_pos=", b"conn=", b"\x1b[2J"]


class BrokenPromise(Exception):
    """Something that must be true for each input isn't."""


class TooLong(BaseException):
    """An input takes too long. The readers catch no exception of this base."""


def require(kept, promise):
    if not kept:
        raise BrokenPromise(promise)


def finite(strokes):
    return all(math.isfinite(value) for stroke in strokes for point in stroke for value in point)


# ---- what is tried with a file


def read_drawing(path):
    strokes, _ = drawing.read_drawing(path)
    require(all(strokes), "each stroke has a point")
    require(finite(strokes), "each point is finite")
    placed = drawing.placed(strokes, LIMITS)
    require(finite(placed), "each placed point is finite")
    drawing.refuse_beyond(placed, ("x", "y"), LIMITS)
    if sum(len(stroke) for stroke in strokes) <= 60:
        stroke = one_stroke.one_stroke(placed, (0.0, 0.0)).stroke
        require(stroke and finite([stroke]), "one stroke has points")


def read_recording(path):
    command = ["bag" if path.suffix == ".bag" else "trace", str(path), "--steps-per-mm", "80"]
    options = PLOT_MOTION.arguments().parse_args(command)
    curves, _ = options.curves(options)
    for curve in curves:
        for times, values in (curve.position(), curve.speed(), curve.acceleration(), curve.jerk(),
                              curve.speed_over_position(), curve.period_over_position()):
            require(len(times) == len(values), "each value has its place")


def program(name):
    loader = importlib.machinery.SourceFileLoader(name, str(SCRIPTS / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


PLOT_MOTION = program("plot_motion")
TARGETS = {"drawing": read_drawing, "recording": read_recording}


def suffix_of(data):
    """The kind of a file is in its name, and here in its beginning."""
    if data[:7] == b"#ROSBAG":
        return ".bag"
    return ".svg" if data[:1] == b"<" else ".txt"


# ---- one input after another


def is_own(code):
    return code.co_filename.startswith(str(SCRIPTS))


class Lines:
    """The lines of the readers that have been reached."""

    def __init__(self):
        self.reached = set()

    def trace(self, frame, _event, _argument):
        return self._line if is_own(frame.f_code) else None

    def _line(self, frame, _event, _argument):
        self.reached.add((frame.f_code, frame.f_lineno))
        return self._line


def stop(_number, _frame):
    raise TooLong(f"it takes longer than {LONGEST} s")


def why_failed(target, path, lines):
    """Tries a file. Returns what is wrong; None if it was read or refused."""
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
    sys.settrace(lines.trace)
    try:
        TARGETS[target](path)
    except (Undrawable, OSError) as error:
        message = str(error)
        if not message.isprintable() or not message:
            return f"broken promise: a refusal has one line of text: {message!r}"
    except (BrokenPromise, Exception, TooLong) as error:  # pylint: disable=broad-except
        sys.settrace(None)
        kind = "broken promise: " if isinstance(error, BrokenPromise) else ""
        return f"{kind}{error}\n{traceback.format_exc()}"
    finally:
        sys.settrace(None)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return None


def changed(data, inputs, randomly):
    """An input with some changes."""
    data = bytearray(data)
    for _ in range(randomly.choice((1, 1, 1, 2, 3, 5, 8))):
        at = randomly.randrange(len(data) + 1)
        end = min(len(data), at + randomly.choice((1, 1, 2, 4, 8, 32, 200)))
        change = randomly.randrange(7)
        if change == 0 and at < len(data):
            data[at] = randomly.randrange(256)
        elif change == 1 and at < len(data):
            data[at] ^= 1 << randomly.randrange(8)
        elif change == 2:
            del data[at:end]
        elif change == 3:
            data[at:at] = randomly.choice(WORDS)
        elif change == 4:
            data[at:end] = randomly.choice(WORDS)
        elif change == 5:
            data[at:at] = data[at:end] * randomly.choice((1, 1, 2, 10))
        else:
            other = randomly.choice(inputs)
            begin = randomly.randrange(len(other) + 1)
            data[at:end] = other[begin:begin + randomly.choice((4, 16, 64, 256))]
    return bytes(data[:LARGEST])


class Fuzzer:
    def __init__(self, options, folder):
        self.options = options
        self.folder = folder
        self.lines = Lines()
        self.inputs = []
        self.tried = 0
        self.all_inputs = hashlib.sha1()

    def fails(self, data):
        """Tries an input, and keeps it if it reaches a new line. Returns whether it fails."""
        before = len(self.lines.reached)
        path = self.folder / f"input{suffix_of(data)}"
        path.write_bytes(data)
        why = why_failed(self.options.target, path, self.lines)
        self.tried += 1
        self.all_inputs.update(data)
        if why:
            found = f"{self.options.found}{hashlib.sha1(data).hexdigest()}"
            pathlib.Path(found).write_bytes(data)
            print(f"{why}\nTest unit written to {found}")
            return True
        if len(self.lines.reached) > before:
            self.inputs.append(data)
            if self.options.kept:
                (self.options.kept / hashlib.sha1(data).hexdigest()).write_bytes(data)
        return False

    def run(self):
        """Returns whether an input fails."""
        files = [file for place in self.options.files
                 for file in (sorted(place.iterdir()) if place.is_dir() else [place])]
        beginnings = [file.read_bytes() for file in files]
        if any([self.fails(data) for data in beginnings]):
            return True
        self.inputs = beginnings + self.inputs
        randomly = random.Random(self.options.seed)
        end = time.monotonic() + self.options.seconds
        while self.tried < self.options.runs or time.monotonic() < end:
            if self.fails(changed(randomly.choice(self.inputs), self.inputs, randomly)):
                return True
        return False


def main(words):
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("target", choices=sorted(TARGETS))
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--runs", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=pathlib.Path)
    parser.add_argument("--found", default="found-")
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    options = parser.parse_args(words)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGVTALRM, stop)
    with tempfile.TemporaryDirectory() as folder:
        fuzzer = Fuzzer(options, pathlib.Path(folder))
        failed = fuzzer.run()
    print(f"#{fuzzer.tried} DONE cov: {len(fuzzer.lines.reached)} inputs: {fuzzer.all_inputs.hexdigest()}\n"
          f"stat::number_of_executed_units: {fuzzer.tried}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
