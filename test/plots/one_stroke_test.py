import math
import random
import unittest
from collections import Counter

import support  # noqa: F401: the path to the modules
from stepdriver_plots.errors import BadDrawing
from stepdriver_plots.one_stroke import OneStroke, one_stroke


def lines_of(strokes):
    return Counter(frozenset(line) for stroke in strokes for line in zip(stroke, stroke[1:]))


class OneStrokeTest(unittest.TestCase):
    def check(self, strokes, start=(0.0, 0.0)):
        """Checks that every line is drawn, and that the lengths are right."""
        found = one_stroke(strokes, start)
        drawn, wanted = lines_of([found.stroke]), lines_of(strokes)
        for line in wanted:
            self.assertGreaterEqual(drawn[line], 1, line)
        length = sum(math.dist(a, b) for a, b in zip(found.stroke, found.stroke[1:]))
        added = sum(math.dist(*line) for line in drawn if line not in wanted)
        once = sum(math.dist(*line) for line in drawn)
        self.assertAlmostEqual(found.length, length)
        self.assertAlmostEqual(found.added, added)
        self.assertAlmostEqual(found.twice, length - once)
        return found

    def test_draws_a_house_of_eight_lines_without_drawing_one_twice(self):
        a, b, c, d, roof = (0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 3.0)
        found = self.check([[a, b], [b, c], [c, d], [d, a], [a, c], [b, d], [d, roof], [roof, c]])
        self.assertEqual(found.twice, 0.0)
        self.assertEqual(found.added, 0.0)
        self.assertEqual(len(found.stroke), 9)

    def test_says_only_what_it_had_to_add(self):
        self.assertEqual(OneStroke([], 933.2, 0.0, 0.2).text(), "one stroke of 933 mm")
        self.assertEqual(OneStroke([], 933.2, 22.9, 0.0).text(),
                         "one stroke of 933 mm: 23 mm are drawn twice")
        self.assertEqual(OneStroke([], 40.0, 2.0, 1.0).text(),
                         "one stroke of 40 mm: 2 mm are drawn twice and 1 mm join parts that don't "
                         "touch")

    def test_goes_back_along_a_line_that_leads_nowhere(self):
        # A star of three rays: the stroke begins and ends with two of them, and draws the third twice.
        middle = (0.0, 0.0)
        found = self.check([[middle, (1.0, 0.0)], [middle, (0.0, 2.0)], [middle, (-3.0, 0.0)]],
                           (-3.0, 0.0))
        self.assertEqual(found.stroke[0], (-3.0, 0.0))
        self.assertEqual(found.twice, 1.0)

    def test_joins_parts_that_do_not_touch_by_the_shortest_line(self):
        found = self.check([[(0.0, 0.0), (1.0, 0.0)], [(3.0, 0.0), (5.0, 0.0)]])
        self.assertEqual(found.added, 2.0)
        self.assertEqual(found.twice, 0.0)

    def test_draws_a_line_that_comes_twice_only_once(self):
        found = self.check([[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)]])
        self.assertEqual(found.length, 1.0)

    def test_begins_near_the_pen_if_it_may_begin_anywhere(self):
        square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]
        self.assertEqual(self.check([square], (2.0, 2.0)).stroke[0], (1.0, 1.0))

    def test_refuses_lines_of_no_length(self):
        with self.assertRaises(BadDrawing) as caught:
            one_stroke([[(0.0, 0.0), (0.0, 1e-6)], [(50.0, 0.0), (50.0, 1e-6)]], (0.0, 0.0))
        self.assertIn("shorter than 0.0005 mm", str(caught.exception))

    def test_goes_through_dots(self):
        found = self.check([[(0.0, 0.0), (1.0, 0.0)], [(3.0, 0.0)]])
        self.assertEqual(found.stroke, [(0.0, 0.0), (1.0, 0.0), (3.0, 0.0)])
        self.assertEqual(one_stroke([[(3.0, 4.0)]], (0.0, 0.0)).stroke, [(3.0, 4.0)])

    def test_points_that_differ_by_rounding_are_one(self):
        for seed in range(40):
            dice = random.Random(seed)
            a, b, c = ((dice.uniform(0, 100), dice.uniform(0, 100)) for _ in range(3))
            near = tuple(value + dice.uniform(-3e-4, 3e-4) for value in b)
            found = one_stroke([[a, b], [near, c], [(0.0, 0.0), (100.0, 100.0)]], a)
            self.assertIn([a, b, c], [found.stroke[:3], found.stroke[-3:][::-1]] + [
                list(three) for three in zip(found.stroke, found.stroke[1:], found.stroke[2:])] + [
                list(three)[::-1] for three in zip(found.stroke, found.stroke[1:], found.stroke[2:])])

    def test_draws_any_drawing(self):
        for seed in range(60):
            chance = random.Random(seed)
            points = [(chance.uniform(0, 9), chance.uniform(0, 9)) for _ in range(12)]
            strokes = [[chance.choice(points) for _ in range(chance.randint(2, 6))]
                       for _ in range(chance.randint(1, 7))]
            strokes = [[p for p, q in zip(s, s[1:] + [None]) if p != q] for s in strokes]
            strokes = [stroke for stroke in strokes if len(stroke) > 1]
            if strokes:
                self.check(strokes, (chance.uniform(0, 9), 0.0))


if __name__ == "__main__":
    unittest.main()
