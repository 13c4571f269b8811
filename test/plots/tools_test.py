import argparse
import pathlib
import tempfile
import unittest

import support
from stepdriver_plots import drawing
from stepdriver_plots.errors import BadDrawing
from stepdriver_plots.stroke import Stroke
from stepdriver_plots.tools import Choice, Tools, choice, marks

RED, BLUE = "#ff0000", "#0000ff"


class ToolsTest(unittest.TestCase):
    def test_are_one_for_all_strokes_or_chosen_by_their_colours(self):
        strokes = [Stroke([(0, 0)], RED), Stroke([(1, 0)], BLUE), Stroke([(2, 0)])]
        self.assertEqual(Tools([Choice("", "pen")]).of(strokes, "a.svg"), ["pen"] * 3)
        tools = Tools([Choice(RED, "cut"), Choice("", "mark")])
        self.assertEqual(tools.of(strokes, "a.svg"), ["cut", "mark", "mark"])
        self.assertEqual(tools.outputs, ["cut", "mark"])
        self.assertTrue(tools.by_colour)
        self.assertFalse(Tools([Choice("", "pen")]).by_colour)
        self.assertEqual(Tools([]).outputs, [])
        self.assertEqual(Tools([Choice(RED, "pen"), Choice(BLUE, "pen")]).outputs, ["pen"])

    def test_a_colour_without_an_output_is_refused(self):
        strokes = [Stroke([(0, 0)], RED), Stroke([(1, 0)], BLUE), Stroke([(2, 0)])]
        with self.assertRaises(BadDrawing) as caught:
            Tools([Choice(RED, "cut")]).of(strokes, "a.svg")
        self.assertIn("a.svg: has strokes in #0000ff, no colour, for which no output is given", str(caught.exception))
        with self.assertRaises(BadDrawing):
            Tools([Choice(RED, "cut"), Choice(RED, "mark")])

    @support.reads_svg
    def test_colours_are_those_of_css(self):
        self.assertEqual(choice("pen"), Choice("", "pen"))
        self.assertEqual(choice("red=cut"), Choice(RED, "cut"))
        self.assertEqual(choice("#00f=cut"), Choice(BLUE, "cut"))
        self.assertEqual(choice("Black=cut"), Choice("#000000", "cut"))
        for wrong in ("", "=cut", "red=", "reddish=cut", "none=cut"):
            with self.assertRaises(argparse.ArgumentTypeError, msg=wrong):
                choice(wrong)

    def test_marks_are_where_the_output_changes(self):
        self.assertEqual(marks(["a"], [None, "a", "a", None, "a"]),
                         [(0, "a", False), (1, "a", True), (3, "a", False), (4, "a", True), (5, "a", False)])
        self.assertEqual(marks(["a", "b"], ["b", "a"]),
                         [(0, "a", False), (0, "b", True), (1, "b", False), (1, "a", True), (2, "a", False),
                          (2, "b", False)])

    @support.reads_svg
    def test_strokes_keep_the_colours_of_an_svg(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "a.svg"
            file.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 50 50">'
                            '<g stroke="blue" fill="none"><path d="M0 0H10"/><path d="M5 5H60"/></g>'
                            '<path d="M0 20H10V30Z" fill="lime" stroke="#123456"/>'
                            '<rect x="20" y="20" width="5" height="5"/></svg>')
            strokes, _ = drawing.read_drawing(file)
            colours = [BLUE, BLUE, "#123456", "#000000"]
            self.assertEqual([stroke.colour for stroke in strokes], colours)
            placed = drawing.placed(strokes, ((0.0, 100.0), (0.0, 100.0)))
            self.assertEqual([stroke.colour for stroke in placed], colours)


if __name__ == "__main__":
    unittest.main()
