import unittest

import support  # noqa: F401: the path to the modules
from stepdriver_plots.drawn_path import cut_to_lines, deviations, offset, path_of_pulses


class DrawnPathTest(unittest.TestCase):
    def test_puts_the_pulses_of_both_axes_in_order(self):
        path = path_of_pulses((10.0, 20.0), [([0.1, 0.3], [1, 2]), ([0.2], [-1])], (1.0, 0.5))
        self.assertEqual(path, [(10.0, 20.0), (11.0, 20.0), (11.0, 19.5), (12.0, 19.5)])

    def test_cuts_it_where_each_line_ended(self):
        self.assertEqual(cut_to_lines("abcdef", [2, 0, 3]), ["abc", "c", "cdef"])

    def test_measures_to_a_line_and_not_beyond_its_ends(self):
        self.assertEqual(offset((1.0, 1.0), (0.0, 0.0), (2.0, 0.0)), (0.0, 1.0))
        self.assertEqual(offset((3.0, 1.0), (0.0, 0.0), (2.0, 0.0)), (1.0, 1.0))
        self.assertEqual(offset((3.0, 4.0), (0.0, 0.0), (0.0, 0.0)), (3.0, 4.0))

    def test_says_how_far_each_axis_is_off_its_own_line(self):
        off = deviations([[(0.0, 0.125), (1.5, 0.0)], [(5.25, 4.5), (5.0, 5.0)]],
                         [((0, 0), (1, 0)), ((5, 5), (5, 4))])
        self.assertEqual(off, (0.5, 0.125))


if __name__ == "__main__":
    unittest.main()
