"""The path to the modules under test, and motions for them."""

import importlib.util
import pathlib
import shutil
import sys
import unittest

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"
sys.path.insert(0, str(SCRIPTS))

# Ubuntu 20.04 lacks it.
reads_svg = unittest.skipUnless(
    importlib.util.find_spec("svgelements") and importlib.util.find_spec("shapely") and
    shutil.which("rsvg-convert"), "there is no python3-svgelements, python3-shapely or librsvg2-bin")

VCD = """\
$version by hand $end
$timescale 1 us $end
$scope module x $end
$var wire 1 a step $end
$var wire 1 b dir $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
%da
%db
$end
"""


def vcd(levels, edges):
    """A trace of an axis x. levels: the first levels of STEP and DIR; edges: (us, "a" or "b", level)."""
    return VCD % levels + "".join(f"#{time}\n{level}{pin}\n" for time, pin, level in edges)


def ramp(steps, acceleration):
    """Times of the steps of a motion from rest."""
    return [(2 * (i + 0.5) / acceleration) ** 0.5 for i in range(steps)]
