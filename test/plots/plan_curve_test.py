import pathlib
import tempfile
import unittest

import support  # noqa: F401: the path to the modules
from stepdriver_plots.figure import draw_motion
from stepdriver_plots.plan_curve import Piece, PlanCurve

# 1 mm/ms^2 up, cruise, down; in m and s: 0.1 m/s after 0.1 s.
TRAPEZOID = [Piece(0.1, 0.0, 0.0, 1.0, 0.0), Piece(0.2, 0.005, 0.1, 0.0, 0.0),
             Piece(0.1, 0.025, 0.1, -1.0, 0.0)]


class PlanCurveTest(unittest.TestCase):
    def setUp(self):
        self.curve = PlanCurve(TRAPEZOID, "x", "m", 1.0 / 80000.0)

    def test_ends_where_the_pieces_do(self):
        times, places = self.curve.position()
        self.assertAlmostEqual(times[-1], 0.4)
        self.assertAlmostEqual(places[-1], 0.03)
        self.assertAlmostEqual(self.curve.speed()[1][-1], 0.0)

    def test_speed_over_position_obeys_torricelli(self):
        for place, speed in zip(*self.curve.speed_over_position()):
            self.assertAlmostEqual(speed ** 2, min(2 * place, 0.01, 2 * (0.03 - place)), places=9)

    def test_period_is_the_way_of_a_step_over_the_speed(self):
        places, periods = self.curve.period_over_position()
        self.assertAlmostEqual(min(periods), 125.0, places=6)
        self.assertTrue(all(0.0 < period <= 2600.0 for period in periods), max(periods))
        self.assertGreater(len(places), 300)

    def test_acceleration_and_jerk_are_those_of_the_pieces(self):
        s_curve = PlanCurve([Piece(0.1, 0.0, 0.0, 0.0, 10.0), Piece(0.1, 0.1, 0.05, 1.0, -10.0)])
        self.assertEqual(s_curve.acceleration()[1], [0.0, 1.0, 1.0, 0.0])
        self.assertEqual(s_curve.jerk()[1], [10.0, 10.0, -10.0, -10.0])

    def test_has_no_jerk_without_a_jerk_limit(self):
        self.assertFalse(self.curve.has_jerk_limit)
        self.assertEqual(self.curve.jerk(), ([], []))
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder) / "plan.svg"
            draw_motion([self.curve], picture)
            self.assertTrue("no jerk to show" in picture.read_text())

    def test_scales_all_of_it(self):
        scaled = self.curve.scaled(1000.0, "mm")
        self.assertEqual(scaled.unit, "mm")
        self.assertAlmostEqual(scaled.position()[1][-1], 30.0)
        self.assertAlmostEqual(max(scaled.speed()[1]), 100.0)
        self.assertAlmostEqual(min(scaled.period_over_position()[1]), 125.0, places=6)


if __name__ == "__main__":
    unittest.main()
