import math
import pathlib
import tempfile
import unittest

import support  # noqa: F401: the path to the modules
from stepdriver_plots.figure import draw_motion
from stepdriver_plots.plan_curve import Piece, PlanCurve
from stepdriver_plots.resonance import shapers
from stepdriver_plots.spring import deflection, ringing

TRAPEZOID = PlanCurve([Piece(0.01, 0.0, 0.0, 10.0, 0.0), Piece(0.04, 0.0005, 0.1, 0.0, 0.0),
                       Piece(0.01, 0.0045, 0.1, -10.0, 0.0)])
S_CURVE = PlanCurve([Piece(0.01, 0.0, 0.0, 0.0, 1000.0), Piece(0.01, 1000.0 / 6e6, 0.05, 10.0, -1000.0),
                     Piece(0.01, 0.001, 0.1, 0.0, -1000.0),
                     Piece(0.01, 0.001 + 0.001 - 1000.0 / 6e6, 0.05, -10.0, 1000.0)])


class SpringTest(unittest.TestCase):
    def test_is_what_small_steps_of_time_give(self):
        frequency, damping, step = 30.0, 0.07, 1e-6
        w = 2.0 * math.pi * frequency
        times, values = deflection(S_CURVE, frequency, damping)
        u = rate = time = 0.0
        seen = dict(zip(times, values))
        for at in sorted(seen):
            while time < at:
                acceleration = 0.0
                for start, piece in zip(S_CURVE.starts, S_CURVE.pieces):
                    if start <= time < start + piece.duration:
                        acceleration = piece.acceleration + piece.jerk * (time - start)
                rate += step * (-acceleration - 2 * damping * w * rate - w * w * u)
                u += step * rate
                time += step
            self.assertAlmostEqual(seen[at], u, delta=3e-6)
        self.assertGreater(max(abs(u) for u in values), 1e-4)

    def test_a_shaper_stops_it(self):
        for curve in (TRAPEZOID, S_CURVE):
            before = ringing(curve, 30.0, 0.05)
            self.assertGreater(before, 5e-5)
            for shaper in shapers(30.0, 0.05):
                shaped = curve.shaped(shaper.parts, shaper.delays)
                allowed = 0.01 if shaper.name in ("zv", "mzv") else 0.08
                self.assertLess(ringing(shaped, 30.0, 0.05), allowed * before, shaper.name)
                self.assertAlmostEqual(shaped.position()[1][-1], curve.position()[1][-1])
                self.assertAlmostEqual(shaped.position()[0][-1],
                                       curve.position()[0][-1] + shaper.delays[-1])

    def test_a_shaped_move_is_the_sum_of_its_parts(self):
        shaped = TRAPEZOID.shaped([0.25, 0.75], [0.0, 0.02], "shaped")
        self.assertEqual(len(shaped.pieces), 7)
        self.assertEqual(shaped.label, "shaped")
        self.assertAlmostEqual(max(shaped.speed()[1]), 0.1)
        self.assertAlmostEqual(shaped.pieces[1].velocity, 0.025)
        self.assertAlmostEqual(sum(piece.duration for piece in shaped.pieces), 0.08)

    def test_is_drawn_below_the_motion(self):
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder) / "plan.svg"
            draw_motion([TRAPEZOID], picture, "", [("42 Hz", *deflection(TRAPEZOID, 42.0, 0.1))])
            self.assertIn("deflection [m]", picture.read_text())


if __name__ == "__main__":
    unittest.main()
