import argparse
import importlib.machinery
import importlib.util
import math
import random
import unittest

import support
from stepdriver_plots.errors import Undrawable
from stepdriver_plots.resonance import (POINTS, amplitude_at, largest_amplitude, left_by, oscillation,
                                        peaks_of, proposal, shapers)


def response(frequency, own, damping):
    """What an accelerometer on the mass shows of an oscillation of the axis with amplitude 1."""
    r = frequency / own
    return abs(1.0 / complex(1.0 - r * r, 2.0 * damping * r))


def program():
    loader = importlib.machinery.SourceFileLoader("measure_resonance", str(support.SCRIPTS / "measure_resonance"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("measure_resonance", loader))
    loader.exec_module(module)
    return module


class OwnNode:
    """What measure_resonance asks of a node."""

    def __init__(self, **params):
        self.params = {"max_speed_mm_s": 100.0, "acceleration_mm_s2": 1000.0, **params}

    def scale(self, _):
        return 1000.0, "mm"

    def axis_param(self, _, key, default=None):
        return self.params.get(key, default)


FREQUENCIES = [float(f) for f in range(10, 101)]


class ResonanceTest(unittest.TestCase):
    def test_an_oscillation_begins_and_ends_at_rest_within_its_limits(self):
        amplitude = largest_amplitude(20.0, 0.1, 3.0, 0.0)
        self.assertAlmostEqual(amplitude * (2.0 * math.pi * 20.0) ** 2, 3.0)
        points = oscillation(20.0, amplitude, 1.0)
        self.assertEqual(len(points), 20 * POINTS)
        self.assertAlmostEqual(points[-1].time, 1.0)
        self.assertAlmostEqual(points[-1].position, 0.0)
        self.assertAlmostEqual(points[-1].velocity, 0.0)
        for before, after in zip(points, points[1:]):
            mean = (after.position - before.position) / (after.time - before.time)
            self.assertAlmostEqual(mean, (before.velocity + after.velocity) / 2.0, delta=2e-3)
            change = abs(after.velocity - before.velocity) / (after.time - before.time)
            self.assertLess(change, 3.0)
        self.assertAlmostEqual(largest_amplitude(20.0, 1e-6, 3.0, 0.0), 1e-6 / (40.0 * math.pi))
        self.assertAlmostEqual(largest_amplitude(20.0, 1.0, 3.0, 1.0), 1.0 / (40.0 * math.pi) ** 3)

    def test_finds_the_amplitude_at_a_frequency_in_noise(self):
        dice = random.Random(3)
        times = [i * 0.002 + dice.uniform(0.0, 0.0005) for i in range(600)]
        values = [9.81 + 0.5 * math.sin(2.0 * math.pi * 37.0 * t + 1.0) + dice.gauss(0.0, 0.2)
                  + 0.3 * math.sin(2.0 * math.pi * 90.0 * t) for t in times]
        self.assertAlmostEqual(amplitude_at(37.0, times, values), 0.5, delta=0.05)
        self.assertLess(amplitude_at(55.0, times, values), 0.05)

    def test_finds_frequency_and_damping_of_a_peak(self):
        for own, damping in ((42.3, 0.05), (23.7, 0.1), (71.0, 0.03)):
            [peak] = peaks_of(FREQUENCIES, [response(f, own, damping) for f in FREQUENCIES])
            self.assertAlmostEqual(peak.frequency, own, delta=0.02 * own)
            self.assertAlmostEqual(peak.damping, damping, delta=0.25 * damping)

    def test_finds_two_peaks_the_higher_one_first(self):
        both = [response(f, 31.0, 0.06) + response(f, 74.0, 0.05) for f in FREQUENCIES]
        first, second = peaks_of(FREQUENCIES, both)
        self.assertAlmostEqual(first.frequency, 74.0, delta=1.0)
        self.assertAlmostEqual(second.frequency, 31.0, delta=1.0)

    def test_proposes_the_shortest_shaper_that_leaves_little(self):
        narrow = [response(f, 42.0, 0.01) for f in FREQUENCIES]
        [peak] = peaks_of(FREQUENCIES, narrow)
        shaper, left = proposal(FREQUENCIES, narrow, peak)
        self.assertEqual(shaper.name, "zv")
        self.assertLessEqual(left, 0.05)
        wide = [response(f, 42.0, 0.1) for f in FREQUENCIES]
        [peak] = peaks_of(FREQUENCIES, wide)
        shaper, left = proposal(FREQUENCIES, wide, peak)
        self.assertNotEqual(shaper.name, "zv")
        self.assertLess(left, left_by(shapers(peak.frequency, peak.damping)[0], 50.0, peak.damping))

    def test_says_what_the_configuration_refuses_together_with_the_proposal(self):
        measure = program()
        self.assertEqual(measure.contradictions(OwnNode(), "x", "mm"), [])
        found = measure.contradictions(OwnNode(backlash_mm=0.05, start_speed_mm_s=2.0), "x", "mm")
        self.assertEqual(measure.lines_of([], found),
                         ["# remove start_speed_mm_s: it can't be combined with an input_shaper",
                          "# remove backlash_mm: it can't be combined with an input_shaper", "input_shaper:"])

    def test_measures_only_frequencies_of_which_there_are_shapers(self):
        measure = program()
        for low, high, good in ((0.5, 1000.0, True), (0.4, 10.0, False), (10.0, 1001.0, False)):
            options = argparse.Namespace(low=low, high=high, step=10.0)
            if good:
                self.assertEqual(measure.frequencies(options)[0], low)
                continue
            with self.assertRaises(Undrawable) as caught:
                measure.frequencies(options)
            self.assertIn("an input_shaper is for frequencies from 0.5 to 1000 Hz", str(caught.exception))

    def test_the_shapers_are_those_of_the_driver(self):
        for damping in (0.0, 0.05, 0.2):
            zv, mzv, ei, two_humps = shapers(42.0, damping)
            self.assertLess(left_by(zv, 42.0, damping), 1e-9)
            self.assertLess(left_by(mzv, 42.0, damping), 1e-9)
            for shaper in (ei, two_humps):
                self.assertLessEqual(left_by(shaper, 42.0, damping), 0.0501)
                for part in (0.9, 1.1):
                    self.assertLessEqual(left_by(shaper, part * 42.0, damping), 0.0501)
            for shaper in (zv, mzv, ei, two_humps):
                self.assertAlmostEqual(sum(shaper.parts), 1.0)
        self.assertEqual([len(shaper.parts) for shaper in shapers(42.0, 0.1)], [2, 3, 3, 4])
        self.assertAlmostEqual(shapers(42.0, 0.0)[2].delays[-1], 1.0 / 42.0)


if __name__ == "__main__":
    unittest.main()
