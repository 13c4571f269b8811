import contextlib
import importlib.machinery
import importlib.util
import io
import math
import types
import unittest

import support
from stepdriver_plots.errors import Undrawable
from stepdriver_plots.stall import CYCLE, SGT, Sample, at_speed, middle_of, most_sensitive, places_of, threshold_of


def program():
    loader = importlib.machinery.SourceFileLoader("tune_stall", str(support.SCRIPTS / "tune_stall"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("tune_stall", loader))
    loader.exec_module(module)
    return module


class OwnNode:
    """What tune_stall asks of a node."""

    name = "/stepdriver"

    def __init__(self, **params):
        self.params = {"driver": "tmc2209", "tmc": {"port": "/dev/serial0"}, "homing/seek_speed_mm_s": 50.0,
                       "homing/kind": "stall", "microsteps": 16, **params}

    def scale(self, _):
        return 1000.0, "mm"

    def axis_param(self, _, key, default=None):
        return self.params.get(key, default)

    def place_of(self, _):
        return types.SimpleNamespace(steps_per_unit=80000.0)


def options(**given):
    return types.SimpleNamespace(**{"axis": "x", "distance": 80.0, "speed": None, "current": None, "check": False,
                                    "homings": 4, **given})


class Homings:
    """An axis that ends its homings at these places."""

    name, factor, unit, full_step, way, node = "x", 1000.0, "mm", 2e-4, 0.08, OwnNode()

    def __init__(self, ends):
        self.ends = iter(ends)
        self.moves = []

    def home(self):
        return next(self.ends)

    def move(self, way):
        self.moves.append(way)


class StallTest(unittest.TestCase):
    def test_takes_samples_at_the_constant_speed_only(self):
        ramp = [Sample(0.0, 0.02, 90), Sample(0.001, 0.04, 60)]
        cruise = [Sample(0.003 + 0.0025 * i, 0.05, 300 + i) for i in range(4)]
        end = [Sample(0.012, 0.03, 20)]
        self.assertEqual(at_speed(ramp + cruise + end, 0.05, 2e-4), cruise[1:])
        back = [Sample(-s.position, -s.velocity, s.load) for s in ramp + cruise + end]
        self.assertEqual(len(at_speed(back, 0.05, 2e-4)), 3)
        # A full step of 1 mm: the chip has settled 4 mm later.
        self.assertEqual(at_speed(cruise, 0.05, 1e-3), cruise[2:])
        self.assertEqual(at_speed(ramp, 0.05, 2e-4), [])

    def test_proposes_half_of_the_lowest_value(self):
        self.assertEqual(threshold_of([Sample(0.0, 0.05, load) for load in (400, 200, 333)]), 50)
        self.assertEqual(threshold_of([Sample(0.0, 0.05, 510)]), 127)
        self.assertIsNone(threshold_of([Sample(0.0, 0.05, 3)]))

    def test_finds_the_most_sensitive_threshold_on_spi(self):
        for first in range(SGT[0], SGT[1] + 1):
            asked = []

            def lowest_load(threshold, first=first, asked=asked):
                asked.append(threshold)
                return 100 if threshold >= first else 99

            self.assertEqual(most_sensitive(lowest_load), first)
            self.assertLessEqual(len(asked), 8)
            self.assertIn(first, asked)
        self.assertIsNone(most_sensitive(lambda _: 99))

    def test_finds_the_middle_of_phases_around_zero(self):
        self.assertEqual(middle_of([341, 345, 349]), (345, 8))
        self.assertEqual(middle_of([1020, 4]), (0, 8))
        self.assertEqual(middle_of([1016, 1020])[0], 1018)
        for begin in range(0, CYCLE, 37):
            middle, width = middle_of([begin, (begin + 100) % CYCLE])
            self.assertEqual(width, 100)
            self.assertLessEqual(abs((middle - begin - 50 + 512) % CYCLE - 512), 1)

    def test_adds_the_shifts_of_homings(self):
        places = places_of([0.1, -0.3, 0.1])
        self.assertAlmostEqual(max(places) - min(places), 0.3)
        self.assertEqual(places_of([]), [0.0])

    def test_reads_what_a_homing_says(self):
        found = program().HOMED.search("x is homed at MSCNT 341, -1.25e-05 m from where it was homed before, and "
                                       "stands at -0.04 m")
        self.assertEqual((int(found[1]), float(found[2])), (341, -1.25e-05))
        self.assertIsNone(program().HOMED.search("x is homed at MSCNT 341, and stands at -0.04 m")[2])
        self.assertIsNone(program().HOMED.search("x is homed, and stands at 0 m"))

    def test_takes_its_speed_and_current_from_the_homing(self):
        axis = program().Axis(OwnNode(**{"tmc/stall_current_a": 0.6}), options())
        self.assertAlmostEqual(axis.speed, 0.05)
        self.assertAlmostEqual(axis.full_step, 2e-4)
        self.assertAlmostEqual(axis.current, 0.6)
        self.assertAlmostEqual(program().Axis(OwnNode(), options(speed=30.0)).speed, 0.03)

    def test_refuses_what_measures_no_load(self):
        for params, given, said in (
                ({"driver": "tmc2208"}, {}, "must be one of tmc2209, tmc2226, tmc2130, tmc5160"),
                ({"tmc": None}, {}, "with tmc/port"),
                ({"tmc/mode": "spreadcycle"}, {}, "with stealthchop only"),
                ({"driver": "tmc2130"}, {}, "with spreadcycle only"),
                ({"driver": "tmc5160", "tmc/mode": "spreadcycle", "tmc/stall_fault_threshold": 0}, {},
                 "has tmc/stall_fault_threshold"),
                ({"homing/kind": "limit"}, {"check": True}, "must have homing/kind: stall"),
                ({"homing/seek_speed_mm_s": None}, {}, "give the speed with --speed"),
                ({"tmc/spreadcycle_above_mm_s": 50.0}, {}, "must be below tmc/spreadcycle_above_mm_s, 50 mm/s")):
            with self.assertRaises(Undrawable) as caught:
                program().Axis(OwnNode(**params), options(**given))
            self.assertIn(said, str(caught.exception))

    @staticmethod
    def check(axis):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            program().check(options(), axis)
        return said.getvalue()

    def test_checks_homings_from_all_over_the_distance(self):
        axis = Homings([(340, None), (344, 1.25e-5), (342, 0.0), (339, -2.5e-5)])
        said = self.check(axis)
        self.assertIn("4 homings ended within 0.025 mm, 0.125 full steps", said)
        self.assertIn("stall_phase: 342", said)
        self.assertEqual(len(axis.moves), 4)
        self.assertGreater(max(axis.moves) - min(axis.moves), 0.03)
        self.assertTrue(all(0.0 < way < 0.08 for way in axis.moves))

    def test_ends_with_a_homing_at_another_place(self):
        axis = Homings([(340, None), (344, 1e-5), (344, 5e-4), (339, 0.0)])
        with self.assertRaises(Undrawable) as caught:
            self.check(axis)
        self.assertIn("homing 3 of x ended 0.5 mm from the one before", str(caught.exception))
        self.assertTrue(math.isclose(axis.moves[-1], 2 * 0.618 % 1.0 * 0.08))


if __name__ == "__main__":
    unittest.main()
