"""Motions of several axes."""

import math
import unittest

from stepdriver_core import MoveEnd, NotReached, Refused, arc_around, arc_through, bezier, line

import support


class Lines(support.MachineTest):
    CONFIG = support.two_axes()

    def test_begin_and_end_together(self):
        move = self.machine.move_line({"x": 0.1, "y": 0.05})
        self.assertEqual(move.targets, {"x": 0.1, "y": 0.05})
        self.assertFalse(move.done)
        self.assertIsNone(move.result)
        self.machine.advance(move.duration / 2)
        self.assertAlmostEqual(self.machine["y"].position, self.machine["x"].position / 2, delta=2e-5)
        result = move.wait()
        self.assertIs(result.end, MoveEnd.REACHED)
        self.assertEqual(result.positions, {"x": 0.1, "y": 0.05})
        self.assertEqual(result.message, "all axes reached their targets")
        self.assertEqual(move.result, result)
        self.assertEqual(repr(move), "<CoordinatedMove of x, y: all axes reached their targets>")
        self.assert_chip_is_well()

    def test_can_be_relative_and_timed(self):
        self.machine.move_line({"x": 0.1, "y": 0.05}).wait()
        move = self.machine.move_line({"x": -0.01, "y": 0.01}, relative=True, duration=4.0)
        self.assertAlmostEqual(move.duration, 4.0, places=6)
        self.assertEqual({name: round(place, 9) for name, place in move.wait().positions.items()},
                         {"x": 0.09, "y": 0.06})

    def test_keep_a_velocity(self):
        self.assertGreater(self.machine.move_line({"x": 0.1}, velocity=0.01).duration, 10.0)

    def test_are_cancelled(self):
        move = self.machine.move_line({"x": 0.1, "y": 0.05})
        self.machine.advance(0.3)
        move.cancel()
        with self.assertRaises(NotReached) as caught:
            move.wait()
        self.assertEqual(set(caught.exception.result.positions), {"x", "y"})
        self.assertIs(move.wait(check=False).end, MoveEnd.STOPPED)

    def test_are_refused_as_a_whole(self):
        for wrong in ({"x": 0.1, "y": 0.5}, {"x": 0.1, "z": 0.1}, {}, {"x": math.nan}):
            with self.assertRaises(Refused):
                self.machine.move_line(wrong)
        with self.assertRaises(TypeError):
            self.machine.move_line({"x": "0.1"})
        self.assertEqual(self.machine.figures.pulses, 0)


class Paths(support.MachineTest):
    CONFIG = support.two_axes()

    def test_follow_lines_arcs_and_beziers(self):
        self.machine.move_line({"x": 0.05, "y": 0.05}).wait()
        segments = [
            line((0.08, 0.05), velocity=0.05),
            arc_around((0.08, 0.09), (0.08, 0.07)),
            arc_through((0.08, 0.05), (0.06, 0.07), velocity=0.04),
            bezier((0.09, 0.05), (0.1, 0.06), (0.1, 0.07), tolerance=0.0),
            [0.1, 0.1],
        ]
        move = self.machine.follow_path(["x", "y"], segments, velocity=0.08, tolerance=1e-4)
        positions = move.wait().positions
        self.assertEqual({name: round(place, 9) for name, place in positions.items()}, {"x": 0.1, "y": 0.1})
        self.assert_chip_is_well()

    def test_an_arc_takes_the_side_that_it_is_told(self):
        highest = {}
        for clockwise in (False, True):
            self.machine.move_line({"x": 0.05, "y": 0.05}).wait()
            move = self.machine.follow_path("xy", [arc_around((0.09, 0.05), (0.07, 0.05), clockwise=clockwise)])
            self.machine.advance(move.duration / 2)
            highest[clockwise] = self.machine["y"].position
            move.wait()
        self.assertAlmostEqual(highest[True], 0.07, delta=1e-4)
        self.assertAlmostEqual(highest[False], 0.03, delta=1e-4)

    def test_an_arc_has_a_plane(self):
        self.machine.move_line({"x": 0.05, "y": 0.05}).wait()
        turned = arc_around((0.05, 0.05), (0.05, 0.07), plane=("y", "x"))
        move = self.machine.follow_path(["x", "y"], [turned])
        self.machine.advance(move.duration / 2)
        self.assertAlmostEqual(self.machine["x"].position, 0.09, delta=1e-4)
        move.wait()

    def test_take_arrays_of_numpy(self):
        try:
            import numpy
        except ImportError:
            self.skipTest("needs numpy")
        turns = numpy.linspace(0.0, 2.0 * numpy.pi, 100)
        points = numpy.column_stack([0.05 + 0.02 * (1.0 - numpy.cos(turns)), 0.05 + 0.02 * numpy.sin(turns)])
        self.machine.move_line({"x": 0.05, "y": 0.05}).wait()
        for rows in (points, points.astype(numpy.float32)):
            self.machine.follow_path(["x", "y"], rows, tolerance=1e-4).wait()
        self.machine.follow_path("xy", [line(numpy.array([0.06, 0.06]))]).wait()
        times = numpy.linspace(0.0, 4.0, 100)
        begin = self.machine.positions
        self.assertAlmostEqual(begin["x"], 0.06, places=9)
        shape = (3.0 * (times / 4.0) ** 2 - 2.0 * (times / 4.0) ** 3)
        rows = numpy.column_stack([0.06 + 0.04 * shape, 0.06 - 0.02 * shape])
        self.machine.follow_trajectory(["x", "y"], times, rows).wait()
        self.machine.move_line({"x": numpy.float64(0.05), "y": numpy.int64(0)}).wait()
        self.machine["x"].move_to(numpy.float32(0.0)).wait()

    def test_name_the_segment_that_is_wrong(self):
        cases = [
            ([(0.01, 0.01), (0.5, 0.01)], "segment 1"),
            ([(0.01, 0.01), arc_around((0.02, 0.01), (0.5, 0.5))], "segment 1"),
            ([(0.01,)], "segment 0"),
            ([arc_around((0.02, 0.01), (0.5,))], "the point of an arc has 1 numbers, but must have 2"),
            ([arc_around((0.02, 0.01), (0.1, 0.1), plane=("x",))], "the plane of an arc has 1 axes, but must have 2"),
            ([arc_around((0.02, 0.01), (0.1, 0.1), plane=("x", "q"))], "'q'"),
            ([(math.inf, 0.01)], "segment 0"),
            ([line((0.01, 0.01), velocity=-1.0)], "segment 0"),
        ]
        for segments, text in cases:
            with self.assertRaises(Refused) as caught:
                self.machine.follow_path(["x", "y"], segments)
            self.assertIn(text, str(caught.exception))
        for wrong in ([("a", 0.1)], [3], 7, [(None, 0.1)]):
            with self.assertRaises(TypeError):
                self.machine.follow_path(["x", "y"], wrong)
        self.assertEqual(self.machine.figures.pulses, 0)

    def test_are_fed_while_they_are_followed(self):
        move = self.machine.follow_path(["x", "y"], [(0.02, 0.0)], tolerance=1e-4, more_follows=True)
        self.assertEqual(move.ahead.segments, 1)
        self.machine.advance(0.1)
        ahead = move.append([(0.04, 0.02), (0.06, 0.0)], more_follows=True)
        self.assertTrue(ahead.more_follows)
        self.assertEqual(ahead.targets, (0.06, 0.0))
        self.assertGreater(ahead.room, 1000)
        self.assertGreater(ahead.time, 0.0)
        self.assertGreater(ahead.passed, 0.0)
        self.machine.advance(10.0)
        self.assertFalse(move.done)
        self.assertFalse(move.append([arc_around((0.06, 0.04), (0.06, 0.02))]).more_follows)
        self.assertAlmostEqual(move.wait().positions["y"], 0.04, places=9)
        self.assertIsNone(move.ahead)
        with self.assertRaises(Refused):
            move.append([(0.1, 0.1)])


class Trajectories(support.MachineTest):
    CONFIG = support.two_axes()

    def test_pass_their_points_at_their_times(self):
        times = [0.0, 1.0, 2.0]
        move = self.machine.follow_trajectory(["x", "y"], times, [(0.0, 0.0), (0.03, 0.01), (0.06, 0.02)],
                                              [(0.0, 0.0), (0.05, 0.01), (0.0, 0.0)])
        self.assertAlmostEqual(move.duration, 2.0, places=2)
        self.machine.advance(1.0)
        self.assertAlmostEqual(self.machine["x"].position, 0.03, delta=1e-3)
        self.assertEqual({name: round(place, 9) for name, place in move.wait().positions.items()},
                         {"x": 0.06, "y": 0.02})

    def test_become_slower_only_if_they_may(self):
        points = ["x"], [0.0, 0.1], [[0.0], [0.1]]
        with self.assertRaises(Refused):
            self.machine.follow_trajectory(*points)
        self.assertGreater(self.machine.follow_trajectory(*points, allow_slower=True).duration, 1.0)

    def test_begin_later(self):
        move = self.machine.follow_trajectory(["x"], [0.0, 2.0], [[0.0], [0.05]], begin_in=1.0)
        self.machine.advance(0.9)
        self.assertEqual(self.machine["x"].position, 0.0)
        move.wait()

    def test_have_a_row_for_each_time(self):
        with self.assertRaisesRegex(Refused, "^the trajectory has 2 times, but 1 rows of positions$"):
            self.machine.follow_trajectory(["x"], [0.0, 1.0], [[0.0]])
        with self.assertRaisesRegex(Refused, "^the trajectory has 1 times, but 2 rows of velocities$"):
            self.machine.follow_trajectory(["x"], [1.0], [[0.1]], [[0.0], [0.0]])
        with self.assertRaisesRegex(Refused, "rows of accelerations$"):
            self.machine.follow_trajectory(["x"], [1.0], [[0.1]], [[0.0]], [])
        with self.assertRaises(Refused):
            self.machine.follow_trajectory(["x"], [], [])
        with self.assertRaises(TypeError):
            self.machine.follow_trajectory(["x"], [0.0, "1"], [[0.0], [0.1]])


if __name__ == "__main__":
    unittest.main()
