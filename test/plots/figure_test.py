import importlib
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

import support  # noqa: F401: the path to the modules
from stepdriver_plots import figure
from stepdriver_plots.plan_curve import Piece, PlanCurve
from stepdriver_plots.step_curve import StepCurve

# [mm], [s]: up to 100 mm/s within 0.1 s, and down again.
TRAPEZOID = [Piece(0.1, 0.0, 0.0, 1000.0, 0.0), Piece(0.2, 5.0, 100.0, 0.0, 0.0),
             Piece(0.1, 25.0, 100.0, -1000.0, 0.0)]
S_CURVE = [Piece(0.1, 0.0, 0.0, 0.0, 10000.0), Piece(0.1, 10 / 6, 50.0, 1000.0, -10000.0)]


class FigureTest(unittest.TestCase):
    def panels(self, curves, deflections=()):
        """The panels of the picture of a motion, by row and column."""
        with mock.patch.object(figure, "save") as save:
            figure.draw_motion(curves, pathlib.Path("none.svg"), "title", deflections)
        (drawn, _), _ = save.call_args
        self.addCleanup(figure.plt.close, drawn)
        return drawn, {(i // 2, i % 2): panel for i, panel in enumerate(drawn.axes)}

    def text_of(self, curves):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "motion.svg"
            figure.draw_motion(curves, path, "title")
            return path.read_text()

    def test_says_which_package_it_needs(self):
        # None: as if it were missing.
        with mock.patch.dict(sys.modules, {"matplotlib": None}):
            sys.modules.pop("stepdriver_plots.figure", None)
            with self.assertRaisesRegex(SystemExit, "python3-matplotlib"):
                importlib.import_module("stepdriver_plots.figure")
        sys.modules["stepdriver_plots.figure"] = figure

    def test_velocities_of_one_direction_begin_at_0(self):
        for sign in (1.0, -1.0):
            pieces = [Piece(p.duration, *(sign * value for value in p[1:])) for p in TRAPEZOID]
            _, panels = self.panels([PlanCurve(pieces, "x", "mm", 0.0125)])
            for place in ((0, 0), (0, 1)):
                self.assertEqual(panels[place].get_ylim()[0 if sign > 0.0 else 1], 0.0)
        there_and_back = TRAPEZOID + [Piece(0.1, 30.0, 0.0, -1000.0, 0.0)]
        _, panels = self.panels([PlanCurve(there_and_back, "x", "mm", 0.0125)])
        self.assertLess(panels[0, 1].get_ylim()[0], -100.0)

    def test_step_periods_have_a_logarithmic_scale(self):
        _, panels = self.panels([PlanCurve(TRAPEZOID, "x", "mm", 0.0125)])
        self.assertEqual(panels[1, 0].get_yscale(), "log")
        self.assertIn(">200<", self.text_of([PlanCurve(TRAPEZOID, "x", "mm", 0.0125)]).replace("\n", ""))

    def test_a_motion_whose_acceleration_jumps_has_no_graph_of_its_jerk(self):
        _, panels = self.panels([PlanCurve(TRAPEZOID, "x", "mm", 0.0125)])
        self.assertFalse(panels[2, 1].axison)
        self.assertIn("no jerk to show", panels[2, 1].texts[0].get_text())
        _, panels = self.panels([PlanCurve(S_CURVE, "x", "mm", 0.0125)])
        self.assertTrue(panels[2, 1].axison)
        self.assertEqual(max(panels[2, 1].lines[0].get_ydata()), 10000.0)

    def test_jumps_of_one_axis_do_not_hide_the_jerk_of_another(self):
        _, panels = self.panels([PlanCurve(TRAPEZOID, "x", "mm", 0.0125), PlanCurve(S_CURVE, "y", "mm", 0.0125)])
        self.assertEqual([len(line.get_xdata()) > 0 for line in panels[2, 1].lines], [False, True])

    def test_legends_are_outside_of_the_panels(self):
        curves = [PlanCurve(TRAPEZOID, name, "mm", 0.0125) for name in "xy"]
        drawn, panels = self.panels(curves, [("x: 25 Hz", [0.0, 1.0], [0.0, 1.0])])
        drawn.canvas.draw()
        legends = [panel.get_legend() for panel in drawn.axes if panel.get_legend()]
        self.assertEqual(len(legends), 2)
        for legend in legends:
            self.assertGreaterEqual(legend.get_window_extent().y0, legend.axes.get_window_extent().y1 - 1.0)

    def test_a_drawing_tells_limits_lines_ways_and_dots_apart(self):
        lines = [((10, 10), (50, 10), True), ((50, 10), (80, 60), False), ((80, 60), (90, 60), False)]
        with mock.patch.object(figure, "save") as save:
            figure.draw_drawing(lines, [(line[:2], line[2]) for line in lines], ((0, 99), (0, 99)),
                                pathlib.Path("none.svg"), "title", dots=[(90, 60)])
        (drawn, _), _ = save.call_args
        self.addCleanup(figure.plt.close, drawn)
        legend = drawn.axes[0].get_legend()
        self.assertEqual([text.get_text() for text in legend.texts],
                         ["soft limits", "lines of the drawing", "dots of the drawing",
                          "where the axes were", "way between strokes"])
        looks = {(line.get_color(), line.get_linestyle(), line.get_linewidth()) for line in legend.get_lines()}
        self.assertEqual(len(looks), 5)
        greys = [colour for colour, *_ in looks if len(set((colour[1:3], colour[3:5], colour[5:7]))) == 1]
        self.assertEqual(len(greys), 1, "only the soft limits have no colour")


if __name__ == "__main__":
    unittest.main()
