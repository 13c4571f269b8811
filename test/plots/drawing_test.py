import pathlib
import tempfile
import unittest

import support
from stepdriver_plots import drawing
from stepdriver_plots.errors import BadDrawing, Undrawable

PAPER = ((0.0, 200.0), (0.0, 150.0))


class DrawingTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def read(self, name, text):
        (self.folder / name).write_text(text)
        return drawing.read_drawing(self.folder / name)

    def test_reads_points_in_strokes(self):
        strokes, in_place = self.read("points.txt", "# mm\n1 2\n3, 4 # there\n3 4\n\n\n5,6\n7 8\n")
        self.assertTrue(in_place)
        self.assertEqual(strokes, [[(1, 2), (3, 4)], [(5, 6), (7, 8)]])

    def test_says_which_line_is_no_point(self):
        for text, words in (("1 2\n3\n", "line 2: 3: isn't a point"), ("1 two\n", "line 1"),
                            ("1 nan\n", "line 1: 1 nan: isn't a point; both numbers must be finite"),
                            ("# only this\n", "contains no line")):
            with self.assertRaises(BadDrawing) as caught:
                self.read("points.txt", text)
            self.assertIn(words, str(caught.exception))

    def test_a_stroke_of_one_point_is_a_dot(self):
        strokes, _ = self.read("points.txt", "1 2\n\n3 4\n3 4\n\n5 6\n7 8\n")
        self.assertEqual(strokes, [[(1, 2)], [(3, 4)], [(5, 6), (7, 8)]])
        self.assertEqual(list(drawing.segments((0, 0), strokes)),
                         [((0, 0), (1, 2), False), ((1, 2), (3, 4), False), ((3, 4), (5, 6), False),
                          ((5, 6), (7, 8), True)])
        self.assertEqual(drawing.placed([[(5.0, 5.0)]], PAPER), [[(100.0, 75.0)]])

    @support.reads_svg
    def test_turns_an_svg_upright_and_fits_it_into_the_limits(self):
        strokes, in_place = self.read("a.svg", '<svg><path d="M0 0H10V20"/></svg>')
        self.assertFalse(in_place)
        (left, top), _, (right, bottom) = drawing.placed(strokes, PAPER)[0]
        self.assertAlmostEqual(top - bottom, 150.0 - 2 * 7.5, delta=1e-4)
        self.assertAlmostEqual(right - left, (150.0 - 2 * 7.5) / 2, delta=1e-4)
        self.assertAlmostEqual((left + right) / 2, 100.0, delta=1e-4)
        self.assertAlmostEqual((top + bottom) / 2, 75.0, delta=1e-4)

    def test_places_by_scale_and_corner(self):
        strokes = [[(1.0, 1.0), (2.0, 3.0)]]
        self.assertEqual(drawing.placed(strokes, ((None, None), PAPER[1]), 10.0, (5.0, 6.0)),
                         [[(5.0, 6.0), (15.0, 26.0)]])
        with self.assertRaises(BadDrawing):
            drawing.placed(strokes, ((None, None), PAPER[1]))

    def test_refuses_a_drawing_that_is_too_small_or_too_large_to_scale(self):
        for stroke in ([(0.0, 0.0), (1e-320, 0.0)], [(1e308, 0.0), (-1e308, 0.0)]):
            with self.assertRaises(BadDrawing) as caught:
                drawing.placed([stroke], PAPER)
            self.assertIn("the drawing can't be scaled: it is ", str(caught.exception))

    def test_refuses_a_point_beyond_the_limits_by_its_axis(self):
        drawing.refuse_beyond([[(0.0, 150.0)]], "xy", PAPER)
        for place, words in (((-1.0, 0.0), "mm is below the soft limit of x, 0 mm"),
                             ((0.0, 151.0), "(0, 151) mm is above the soft limit of y, 150 mm")):
            with self.assertRaises(BadDrawing) as caught:
                drawing.refuse_beyond([[place]], "xy", PAPER)
            self.assertIn(words, str(caught.exception))
        drawing.refuse_beyond([[(-1e9, 0.0)]], "xy", ((None, 0.0), PAPER[1]))

    def test_refuses_a_speed_that_one_of_its_lines_is_too_slow_for(self):
        lines = [((0.0, 0.0), (30.0, 40.0), True), ((30.0, 40.0), (60.0, 40.0), True)]
        drawing.refuse_too_fast(lines, "xy", [100.0, 100.0], 100.0)
        drawing.refuse_too_fast(lines[:1], "xy", [100.0, 100.0], 125.0)
        with self.assertRaises(BadDrawing) as caught:
            drawing.refuse_too_fast(lines, "xy", [100.0, 100.0], 125.0)
        self.assertIn("the speed 125 mm/s is above the 100 mm/s that x and y allow from (30, 40) to",
                      str(caught.exception))

    @support.reads_svg
    def test_refuses_groups_that_are_nested_without_end(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "deep.svg"
            file.write_text("<svg>" + "<g>" * 5000 + "</g>" * 5000 + "</svg>")
            with self.assertRaises(BadDrawing) as caught:
                drawing.read_drawing(file)
            self.assertIn("nested too deeply", str(caught.exception))

    def test_reads_no_device(self):
        with self.assertRaises(Undrawable) as caught:
            drawing.read_drawing(pathlib.Path("/dev/zero"))
        self.assertIn("isn't a file", str(caught.exception))

    def test_goes_from_where_it_stands_through_all_strokes(self):
        lines = list(drawing.segments((0, 0), [[(0, 0), (1, 0)], [(2, 2), (3, 3)]]))
        self.assertEqual(lines, [((0, 0), (1, 0), True), ((1, 0), (2, 2), False),
                                 ((2, 2), (3, 3), True)])


if __name__ == "__main__":
    unittest.main()
