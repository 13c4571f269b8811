"""What programs for drawings write, and what a viewer shows of it."""

import pathlib
import tempfile
import unittest

import support
from stepdriver_plots.errors import BadDrawing
from stepdriver_plots.svg_path import read_svg

SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" %s>%s</svg>'
MM = 'width="100mm" height="60mm" viewBox="0 0 100 60"'
PX = 'width="100" height="60" viewBox="0 0 100 60"'
BOX = [(10, 10), (30, 10), (30, 20), (10, 20), (10, 10)]  # what the paths with this name enclose
PATH = '<path d="M10 10H30V20H10Z"/>'
ACROSS = '<path d="M0 15H100" stroke="black"/>'


@support.reads_svg
class ShownLinesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "drawing.svg"

    def read(self, inside, attributes=MM):
        self.file.write_text(SVG % (attributes, inside))
        return read_svg(self.file)

    def expect(self, inside, strokes, attributes=MM, delta=2e-3):
        found = self.read(inside, attributes)
        self.assertEqual([len(stroke) for stroke in found], [len(s) for s in strokes], f"{inside}: {found}")
        for point, wanted in zip(sum(found, []), sum(strokes, [])):
            self.assertAlmostEqual(point[0], wanted[0], delta=delta, msg=f"{inside}: {found}")
            self.assertAlmostEqual(point[1], wanted[1], delta=delta, msg=f"{inside}: {found}")

    def expect_refused(self, inside, words, attributes=MM):
        with self.assertRaises(BadDrawing) as caught:
            self.read(inside, attributes)
        self.assertIn(words, str(caught.exception))
        self.assertIn(str(self.file), str(caught.exception))

    def test_closed_shapes(self):
        for shape, box in (('<circle cx="50" cy="30" r="25"/>', (25, 75, 5, 55)),
                           ('<ellipse cx="50" cy="30" rx="25" ry="10"/>', (25, 75, 20, 40)),
                           ('<rect x="10" y="10" width="40" height="20" rx="3"/>', (10, 50, 10, 30)),
                           ('<path d="M75 30A25 25 0 1 1 25 30A25 25 0 1 1 75 30Z"/>', (25, 75, 5, 55))):
            (stroke,) = self.read(shape)
            self.assertEqual(stroke[0], stroke[-1], shape)
            xs, ys = zip(*stroke)
            for value, wanted in zip((min(xs), max(xs), min(ys), max(ys)), box):
                self.assertAlmostEqual(value, wanted, delta=0.02, msg=shape)

    def test_hidden_elements_are_not_drawn(self):
        for hidden in ('display="none"', 'style="display:none"', 'style="display: none !important"',
                       'style="DISPLAY:none"', 'visibility="hidden"', 'opacity="0"', 'class="st0"',
                       'stroke-width="0" stroke="black" fill="none"', 'fill="none"', 'fill-opacity="0"',
                       'id="own"', 'class="st1"'):
            style = ("<style>.st0{display:none} g #own{fill:none} g > path.st1{DISPLAY:none}"
                     "text{display:none !important}</style><text>a</text>")
            self.expect(f'{style}<g><path {hidden} d="M0 0L90 5"/></g>{PATH}', [BOX])
            self.expect(f'{style}<g {hidden}><path d="M0 0L90 5"/></g>{PATH}',
                        [BOX] if hidden not in ('id="own"', 'class="st1"') else [[(0, 0), (90, 5)], BOX])

    def test_a_drawing_without_a_shown_line_is_empty(self):
        for inside in ('<path display="none" d="M0 0H90"/>', '<path d="M10 10H20" opacity="0"/>', "",
                       '<path d="M10 12H20" stroke-width="0" stroke="black" fill="none"/>'):
            self.expect(inside, [])

    def test_templates_are_not_drawn(self):
        for name in ("clipPath", "mask", "marker", "pattern", "symbol", "defs"):
            self.expect(f'<{name} id="a" width="4" height="4"><path d="M1 1L5 9"/></{name}>{PATH}', [BOX])

    def test_copies_of_a_symbol_are_scaled(self):
        self.expect('<symbol id="s" viewBox="0 0 10 10"><path d="M0 0H10V10"/></symbol>'
                    '<use href="#s" x="20" y="5" width="50" height="50"/>', [[(20, 5), (70, 5), (70, 55)]])
        self.expect('<defs><path id="o" d="M0 0h8v8h-8z"/></defs>'
                    '<use xlink:href="#o" x="1" transform="translate(12,33) rotate(90)"/>',
                    [[(12, 34), (12, 42), (4, 42), (4, 34), (12, 34)]])

    def test_markers_are_drawn_on_their_lines(self):
        arrow = ('<marker id="a" markerWidth="10" markerHeight="10" refY="3" orient="auto">'
                 '<path d="M0 0L0 6L9 3z"/></marker>')
        self.expect(arrow + '<line x1="20" y1="20" x2="60" y2="20" stroke="black" marker-end="url(#a)"/>',
                    [[(20, 20), (60, 20)], [(60, 17), (60, 23), (69, 20), (60, 17)]])

    def test_boxes_without_paint_are_not_drawn(self):
        box = '<path d="M0 0h100v60H0z" fill="none"/>'
        self.expect(box + PATH, [BOX])
        self.expect('<g><rect class="BoundingBox" stroke="none" fill="none" width="41" height="31"/>'
                    '<path fill="none" stroke="rgb(0,0,0)" d="M1 1L40 30"/></g>', [[(1, 1), (40, 30)]])

    def test_a_white_background_is_not_drawn_but_white_on_black_is(self):
        white = '<rect width="100" height="60" fill="white"/>'
        self.expect(white + PATH, [BOX])
        self.expect(white, [])
        self.expect(PATH + '<path fill="#fff" d="M12 12L18 12L18 18Z"/>',
                    [BOX, [(12, 12), (18, 12), (18, 18), (12, 12)]])

    def test_lines_are_cut_where_they_are_clipped(self):
        clip = '<clipPath id="c">%s</clipPath><g clip-path="url(#c)">%s</g>'
        rect = '<rect x="10" y="10" width="20" height="10"/>'
        for attributes in (PX, MM):
            self.expect(clip % (rect, ACROSS), [[(10, 15), (30, 15)]], attributes, 5e-3)
        self.expect(clip % (rect + '<rect x="50" y="10" width="20" height="10"/>', ACROSS),
                    [[(10, 15), (30, 15)], [(50, 15), (70, 15)]], MM, 5e-3)
        self.expect(clip % ('<path clip-rule="evenodd" d="M10 5H60V25H10ZM30 10H40V20H30Z"/>', ACROSS),
                    [[(10, 15), (30, 15)], [(40, 15), (60, 15)]], MM, 5e-3)
        self.expect(clip % ('<path d="M10 5H60V25H10ZM30 10H40V20H30Z"/>', ACROSS),
                    [[(10, 15), (60, 15)]], MM, 5e-3)
        self.expect(clip % (rect, '<path d="M40 15H50" stroke="black"/>'), [])
        self.expect(clip % ('<rect width="100" height="60"/>', PATH), [BOX])

    def test_lines_are_cut_at_the_edge_of_the_page(self):
        self.expect('<path d="M-20 15H50V80" stroke="black" fill="none"/>',
                    [[(0, 15), (50, 15), (50, 60)]], MM, 5e-3)
        self.expect('<path d="M0 0H100V60H0Z"/>', [[(0, 0), (100, 0), (100, 60), (0, 60), (0, 0)]])

    def test_without_a_size_all_lines_are_drawn(self):
        self.expect('<path d="M-20 -5H50V80" stroke="black"/>', [[(-20, -5), (50, -5), (50, 80)]], "")

    def test_lengths_have_their_units(self):
        for width, size in (("72pt", 25.4), ("6pc", 25.4), ("96px", 96.0), ("96", 96.0), ("1in", 25.4),
                            ("400Q", 100.0), ("2.54cm", 25.4)):
            self.expect('<path d="M0 0H72V72"/>', [[(0, 0), (size, 0), (size, size)]],
                        f'width="{width}" height="{width}" viewBox="0 0 72 72"')
        self.expect('<line x1="1in" y1="0" x2="40Q" y2="72pt" stroke="black"/>', [[(25.4, 0), (10, 25.4)]],
                    'width="100mm" height="100mm"')
        self.expect('<g transform="translate(0,72) scale(0.1,-0.1)"><path d="M100 100l500 0 0 500z"/></g>',
                    [[(x * 25.4 / 72, y * 25.4 / 72) for x, y in ((10, 62), (60, 62), (60, 12), (10, 62))]],
                    'width="144.00pt" height="72.00pt" viewBox="0 0 144 72"')
        self.expect('<path d="M400 600L1900 600" stroke="black"/>', [[(400, 600), (1900, 600)]],
                    'width="100%" height="100%" viewBox="0 0 2000 3000"', 0.01)

    def test_pages_have_their_place_and_aspect(self):
        self.expect('<path d="M10 5H60V25"/>', [[(0, 0), (100, 0), (100, 40)]],
                    'width="100mm" height="40mm" viewBox="10 5 50 20"')
        self.expect('<path d="M0 0H50V100"/>', [[(25, 0), (75, 0), (75, 100)]],
                    'width="100mm" height="100mm" viewBox="0 0 50 100"')
        self.expect('<svg x="50" y="5" width="50" height="50" viewBox="0 0 10 10"><path d="M0 0H10V10"/></svg>',
                    [[(50, 5), (100, 5), (100, 55)]])
        self.expect('<path d="M0 0H10"/>', [[(0, 0), (10, 0)]], 'x="20" y="30" ' + MM)

    def test_transforms_of_styles_are_applied(self):
        self.expect('<g style="transform:translate(20px,10px)"><path d="M0 0H10"/></g>', [[(20, 10), (30, 10)]])

    def test_lines_without_area_or_stroke_are_drawn(self):
        self.expect('<path d="M0 0H10"/><path d="M5 5V20"/><line x1="1" y1="1" x2="9" y2="9"/>',
                    [[(0, 0), (10, 0)], [(5, 5), (5, 20)], [(1, 1), (9, 9)]])

    def test_a_fill_and_its_stroke_are_one_line(self):
        for paint in ('fill="red" stroke="blue"', 'fill="red" stroke="blue" opacity="0.5"',
                      'fill="red" fill-opacity="0.5" stroke="blue" paint-order="stroke"'):
            self.expect(f'<path {paint} d="M10 10H30V20H10Z"/>', [BOX])

    def test_dashed_lines_are_drawn_whole(self):
        self.expect('<path d="M0 5H60" stroke="black" stroke-dasharray="10 10"/>', [[(0, 5), (60, 5)]])

    def test_a_line_of_one_point_is_a_dot_if_a_viewer_shows_it(self):
        for cap, strokes in (("round", [[(5, 5)]]), ("square", [[(5, 5)]]), ("butt", [])):
            self.expect(f'<path d="M5 5h0" stroke="black" stroke-linecap="{cap}"/>', strokes)

    def test_text_is_drawn_by_its_outlines(self):
        strokes = self.read('<text x="10" y="40" font-size="30">T</text>')
        xs, ys = zip(*sum(strokes, []))
        self.assertGreaterEqual(min(xs), 10.0)
        self.assertLess(max(xs), 40.0)
        self.assertAlmostEqual(max(ys), 40.0, delta=0.5)
        self.assertLess(min(ys), 25.0)

    def test_only_the_shown_part_of_a_switch_is_drawn(self):
        self.expect('<switch><foreignObject requiredExtensions="x" width="1" height="1"/><g>' + PATH
                    + "</g></switch>", [BOX])

    def test_images_masks_and_filters_are_refused_only_where_they_are_shown(self):
        pixel = "data:image/png;base64,AAAA"
        for shown in (f'<image href="{pixel}" width="9" height="9"/>',
                      '<image xlink:href="photo.jpg" width="9" height="9"/>',
                      '<filter id="f"><feGaussianBlur stdDeviation="2"/></filter>'
                      '<rect width="9" height="9" filter="url(#f)"/>'):
            self.expect_refused(shown, "an image or a filter effect isn't drawn")
            self.expect(f'<g display="none">{shown}</g>{PATH}', [BOX])
        self.expect_refused('<mask id="m"><circle r="5" fill="white"/></mask>'
                            '<rect width="9" height="9" mask="url(#m)"/>', "a mask isn't drawn")

    def test_nothing_outside_the_file_is_read(self):
        other = self.file.parent / "other.svg"
        other.write_text(SVG % (MM, '<path id="a" d="M0 0L50 50"/>'))
        (self.file.parent / "hide.css").write_text("path{display:none}")
        self.expect_refused('<use href="other.svg#a"/>', "<use> copies 'other.svg#a'")
        self.expect_refused(f'<use xlink:href="{other.as_uri()}#a"/>', "of the file itself")
        self.expect('<style>@import url("hide.css");</style>'
                    '<include xmlns="http://www.w3.org/2001/XInclude" href="other.svg"/>' + PATH, [BOX])
        self.expect_refused("&elsewhere;", "undefined entity")

    def test_files_that_take_too_long_are_refused(self):
        copies = '<path id="a0" d="M0 0H1"/>'
        for i in range(9):
            copies += f'<g id="a{i + 1}">' + f'<use href="#a{i}"/>' * 10 + "</g>"
        self.expect_refused(copies, "rsvg-convert can't interpret it")
        self.expect('<g id="a"><path d="M0 0H1"/><use href="#a"/></g>', [[(0, 0), (1, 0)]])
        self.expect('<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>', [])


if __name__ == "__main__":
    unittest.main()
