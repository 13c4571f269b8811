import unittest

import support  # noqa: F401: the path to the modules
from stepdriver_plots.drawn_path import along, offset, parts, path_of_pulses


class DrawnPathTest(unittest.TestCase):
    def test_puts_the_pulses_of_both_axes_in_order(self):
        path = path_of_pulses((10.0, 20.0), [([0.1, 0.3], [1, 2]), ([0.2], [-1])], (1.0, 0.5))
        self.assertEqual(path, [(10.0, 20.0), (11.0, 20.0), (11.0, 19.5), (12.0, 19.5)])

    def test_measures_to_a_line_and_not_beyond_its_ends(self):
        self.assertEqual(offset((1.0, 1.0), (0.0, 0.0), (2.0, 0.0)), (0.0, 1.0))
        self.assertEqual(offset((3.0, 1.0), (0.0, 0.0), (2.0, 0.0)), (1.0, 1.0))
        self.assertEqual(offset((3.0, 4.0), (0.0, 0.0), (0.0, 0.0)), (3.0, 4.0))

    def test_says_which_line_is_followed_and_how_far_each_axis_is_off_it(self):
        lines = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 4.0))]
        path = [(0.0, 0.0), (2.0, 0.125), (3.75, 0.25), (4.25, 1.0), (4.0, 4.0)]
        self.assertEqual(along(path, lines, 0.5), ((0, 0, 0, 1, 1), (0.25, 0.25)))

    def test_follows_a_line_that_is_drawn_twice_before_the_one_after_it(self):
        lines = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (0.0, 4.0))]
        path = [(0.0, 0.0), (2.0, 0.0), (3.75, 0.0), (2.0, 0.0), (0.0, 0.0), (0.0, 2.0)]
        self.assertEqual(along(path, lines, 0.5), ((0, 0, 0, 0, 0, 2), (0.0, 0.0)))

    def test_does_not_leave_a_line_in_its_middle(self):
        lines = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 4.0))]
        self.assertEqual(along([(0.0, 0.0), (0.0, 3.0)], lines, 0.5), ((0, 0), (0.0, 3.0)))

    def test_cuts_it_where_the_kind_of_line_changes(self):
        self.assertEqual(parts("abcdef", [False, False, True, True, False, False]),
                         [("ab", False), ("bcd", True), ("def", False)])


if __name__ == "__main__":
    unittest.main()
