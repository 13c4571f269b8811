import pathlib
import tempfile
import unittest

import support
from stepdriver_plots.errors import BadDrawing
from stepdriver_plots.svg_path import read_svg

SVG = '<svg xmlns="http://www.w3.org/2000/svg">%s</svg>'


class SvgPathTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "drawing.svg"

    def read(self, inside):
        self.file.write_text(SVG % inside)
        return read_svg(self.file)

    def refusal(self, inside):
        with self.assertRaises(BadDrawing) as caught:
            self.read(inside)
        self.assertIn(str(self.file), str(caught.exception))
        return str(caught.exception)

    def test_reads_shapes_of_straight_lines(self):
        for shape, stroke in (
                ('<polyline points="0,1 2 3, 4,-5"/>', [(0, 1), (2, 3), (4, -5)]),
                ('<polygon points="0 0 1 0 1 1"/>', [(0, 0), (1, 0), (1, 1), (0, 0)]),
                ('<line x1="1" y1="2" x2="3.5"/>', [(1, 2), (3.5, 0)]),
                ('<rect x="1" y="2" width="3" height="4"/>',
                 [(1, 2), (4, 2), (4, 6), (1, 6), (1, 2)])):
            self.assertEqual(self.read(shape), [stroke], shape)

    def test_reads_paths_absolute_and_relative(self):
        for path, strokes in (
                ("M1 2L3 4", [[(1, 2), (3, 4)]]),
                ("m1,2l3,4", [[(1, 2), (4, 6)]]),
                ("M1 2 3 4 5 6", [[(1, 2), (3, 4), (5, 6)]]),
                ("m1 2 3 4 5 6", [[(1, 2), (4, 6), (9, 12)]]),
                ("M0 0H5V6h-1v-1", [[(0, 0), (5, 0), (5, 6), (4, 6), (4, 5)]]),
                ("M1 1h2v2z l5 5", [[(1, 1), (3, 1), (3, 3), (1, 1)], [(1, 1), (6, 6)]]),
                ("M1 1h2z m3 0 h1", [[(1, 1), (3, 1), (1, 1)], [(4, 1), (5, 1)]]),
                ("M10-20.5.5 1e1", [[(10, -20.5), (0.5, 10)]])):
            self.assertEqual(self.read(f'<path d="{path}"/>'), strokes, path)

    def test_goes_into_groups_and_passes_over_what_draws_nothing(self):
        self.assertEqual(
            self.read('<title>t</title><defs><circle r="1"/></defs><!-- c -->'
                      '<x:view xmlns:x="urn:x"/><g><g><path d="M0 0H1"/></g></g>'),
            [[(0, 0), (1, 0)]])

    def test_refuses_what_it_cannot_draw(self):
        for inside, words in (
                ('<circle r="1"/>', "circle isn't drawn: only polyline"),
                ('<path d="M0 0C1 1 2 2 3 3"/>', "d has C where only"),
                ('<path d="M0 0a1 1 0 0 0 2 2"/>', "d has a where only"),
                ('<path d="L1 1"/>', "must begin with M"),
                ('<path d="M0 0L1"/>', "too few numbers behind L"),
                ('<path d="M0 0L1 #"/>', "can't be read from"),
                ('<path d="M0 0L1e999 1"/>', "isn't a finite number"),
                ('<polyline points="0 0 1"/>', "3 numbers"),
                ('<line x2="10mm"/>', 'x2="10mm" isn\'t a finite number without a unit'),
                ('<rect width="1" height="1" rx="2"/>', "round corners"),
                ('<g transform="scale(2)"><path d="M0 0H1"/></g>', "g has a transform")):
            self.assertIn(words, self.refusal(inside))
        self.assertIn("can't be read as SVG", self.refusal("<g>"))

    def test_the_drawing_that_comes_along_can_be_read(self):
        house = pathlib.Path(support.SCRIPTS).parents[1] / "config/drawings/house.svg"
        self.assertEqual(len(read_svg(house)), 7)


if __name__ == "__main__":
    unittest.main()
