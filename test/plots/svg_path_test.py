import math
import pathlib
import tempfile
import unittest

import support
from stepdriver_plots.errors import BadDrawing
from stepdriver_plots.one_stroke import one_stroke
from stepdriver_plots.svg_path import read_svg

SVG = '<svg xmlns="http://www.w3.org/2000/svg" %s>%s</svg>'


@support.reads_svg
class SvgPathTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "drawing.svg"

    def read(self, inside, attributes=""):
        self.file.write_text(SVG % (attributes, inside))
        return read_svg(self.file)

    def expect(self, inside, strokes, attributes=""):
        found = self.read(inside, attributes)
        self.assertEqual([len(stroke) for stroke in found], [len(s) for s in strokes], inside)
        for point, wanted in zip(sum(found, []), sum(strokes, [])):
            self.assertAlmostEqual(point[0], wanted[0], delta=1e-4, msg=inside)
            self.assertAlmostEqual(point[1], wanted[1], delta=1e-4, msg=inside)

    def test_reads_shapes_of_straight_lines(self):
        for shape, stroke in (
                ('<polyline points="0,1 2 3, 4,-5"/>', [(0, 1), (2, 3), (4, -5)]),
                ('<polygon points="0 0 1 0 1 1"/>', [(0, 0), (1, 0), (1, 1), (0, 0)]),
                ('<line x1="1" y1="2" x2="3.5"/>', [(1, 2), (3.5, 0)]),
                ('<rect x="1" y="2" width="3" height="4"/>',
                 [(1, 2), (4, 2), (4, 6), (1, 6), (1, 2)])):
            self.expect(shape, [stroke])

    def test_reads_paths_absolute_and_relative(self):
        for path, strokes in (
                ("M1 2L3 4", [[(1, 2), (3, 4)]]),
                ("m1,2l3,4", [[(1, 2), (4, 6)]]),
                ("M1 2 3 4 5 6", [[(1, 2), (3, 4), (5, 6)]]),
                ("m1 2 3 4 5 6", [[(1, 2), (4, 6), (9, 12)]]),
                ("M0 0H5V6h-1v-1", [[(0, 0), (5, 0), (5, 6), (4, 6), (4, 5)]]),
                ("M1 1h2z m3 0 h1", [[(1, 1), (3, 1), (1, 1)], [(4, 1), (5, 1)]]),
                ("M10-20.5.5 1e1", [[(10, -20.5), (0.5, 10)]])):
            self.expect(f'<path d="{path}"/>', strokes)

    def test_applies_transforms(self):
        self.expect('<g transform="translate(1 2)"><path transform="scale(2)" d="M0 0H1"/></g>',
                    [[(1, 2), (3, 2)]])
        self.expect('<line x2="1" transform="rotate(90)"/>', [[(0, 0), (0, 1)]])

    def test_reads_a_physical_size_in_millimetres(self):
        self.expect('<path d="M0 0H100"/>', [[(0, 0), (50, 0)]],
                    'width="5cm" height="5cm" viewBox="0 0 100 100"')

    def test_makes_chords_of_curves(self):
        (circle,) = self.read('<circle cx="10" cy="20" r="100"/>')
        self.assertAlmostEqual(math.dist(circle[0], (110.0, 20.0)), 0.0, delta=1e-4)
        self.assertEqual(circle[0], circle[-1])
        tolerance = 1e-4 * math.hypot(200.0, 200.0)
        bent = 2.8e-4 * 100.0  # A quarter of a circle is this far from its cubic curve.
        for here, there in zip(circle, circle[1:]):
            middle = [(a + b) / 2 for a, b in zip(here, there)]
            self.assertLess(100.0 - math.dist(middle, (10, 20)), tolerance + bent)
            self.assertAlmostEqual(math.dist(here, (10, 20)), 100.0, delta=bent)
        self.assertLess(len(circle), 400)
        for path in ("M0 0C1 1 2 -1 3 0", "M0 0Q5 5 10 0", "M0 0a1 1 0 0 0 2 2"):
            self.assertGreater(len(self.read(f'<path d="{path}"/>')[0]), 4, path)

    def test_goes_into_groups_and_passes_over_what_draws_nothing(self):
        self.expect('<title>t</title><defs><circle r="1"/></defs><!-- c -->'
                    '<x:view xmlns:x="urn:x"/><g><g><path d="M0 0H1"/></g></g>',
                    [[(0, 0), (1, 0)]])

    def test_refuses_what_is_no_svg(self):
        for inside, words in (("<g>", "can't be read as SVG"), ("\0", "can't be read as SVG")):
            with self.assertRaises(BadDrawing) as caught:
                self.read(inside)
            self.assertIn(words, str(caught.exception))
            self.assertIn(str(self.file), str(caught.exception))
        self.file.write_text("<html/>")
        with self.assertRaises(BadDrawing) as caught:
            read_svg(self.file)
        self.assertIn("it begins with <html>", str(caught.exception))

    def test_draws_the_copies_of_an_element(self):
        self.expect('<defs><g id="a"><path id="b" d="M0 0H1"/></g></defs><use href="#a" x="5"/>'
                    '<use xmlns:l="http://www.w3.org/1999/xlink" l:href="#b" y="2"/>',
                    [[(5, 0), (6, 0)], [(0, 2), (1, 2)]])

    def test_the_drawings_that_come_along_can_be_read(self):
        drawings = pathlib.Path(support.SCRIPTS).parents[1] / "config/drawings"
        self.assertEqual(len(read_svg(drawings / "house.svg")), 7)
        sketch = read_svg(drawings / "sketch.svg")
        self.assertEqual(len(sketch), 1)
        self.assertEqual(one_stroke(sketch, (0.0, 0.0)).twice, 0.0)


if __name__ == "__main__":
    unittest.main()
