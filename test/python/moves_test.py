"""Moves of one axis."""

import math
import unittest

from stepdriver_core import Machine, MoveEnd, NotReached, Refused, Timeout

import support


class Moves(support.MachineTest):
    def test_a_move_is_what_its_pulses_are(self):
        move = self.x.move_to(0.05)
        self.assertFalse(move.done)
        self.assertIsNone(move.result)
        self.assertEqual((move.axis, move.target, move.rest, move.overshoot), ("x", 0.05, 0.05, 0.0))
        self.assertAlmostEqual(move.duration, 0.7, places=3)
        result = move.wait()
        self.assertEqual(result.end, "reached")
        self.assertIs(result.end, MoveEnd.REACHED)
        self.assertEqual(result.message, "x reached 0.05 m")
        self.assertEqual(result.position, 0.05)
        self.assertAlmostEqual(result.duration, 0.7, places=3)
        self.assertTrue(move.done)
        self.assertEqual(move.result, result)
        self.assertEqual(move.wait(0.0), result)
        report = self.machine.rig.report("x")
        self.assertEqual((report.pulses_forward, report.pulses_backward), (4000, 0))
        self.assertEqual(report.carriage, 50.0)
        self.assertEqual(self.machine.figures.pulses, 4000)
        self.assert_chip_is_well()

    def test_relative_moves_count_from_the_target(self):
        self.x.move_to(0.05)
        self.assertEqual(self.x.move_by(-0.01).target, 0.04)
        self.x.move_by(-0.01).wait()
        self.assertAlmostEqual(self.x.position, 0.03, places=9)

    def test_rounds_are_of_the_motor(self):
        self.x.move_rounds(0.5, velocity=0.05).wait()
        self.assertAlmostEqual(self.x.position, 0.02, places=9)

    def test_a_velocity_is_kept(self):
        self.assertGreater(self.x.plan(0.1, velocity=0.02).duration, 5.0)
        self.assertGreater(self.x.move_to(0.1, velocity=0.02).wait().duration, 5.0)

    def test_a_continuous_axis_takes_the_shorter_way(self):
        turning = support.plain(("GPIO17", "GPIO27", "GPIO22"), steps_per_mm=None, steps_per_degree=10.0,
                                max_speed_mm_s=None, max_speed_deg_s=90.0, acceleration_mm_s2=None,
                                acceleration_deg_s2=90.0, min_position_mm=None, max_position_mm=None, continuous=True)
        machine = self.opened({"axes": {"r": turning}}, virtual_time=True)
        axis = machine["r"]
        self.assertEqual((axis.unit, axis.continuous, axis.min_position), ("rad", True, None))
        axis.move_to(1.9 * math.pi, shortest=True).wait()
        self.assertAlmostEqual(axis.position, -0.1 * math.pi, places=6)
        with self.assertRaises(Refused):
            self.x.move_to(0.01, shortest=True)

    def test_a_bounded_wait_leaves_the_move_alone(self):
        move = self.x.move_to(0.05)
        began = self.machine.time
        with self.assertRaises(Timeout) as caught:
            move.wait(0.25)
        self.assertIsInstance(caught.exception, TimeoutError)
        self.assertEqual(str(caught.exception), "the move hasn't ended in 0.25 s; it continues")
        self.assertAlmostEqual(self.machine.time - began, 0.25, places=9)
        self.assertTrue(self.x.state.moving)
        with self.assertRaises(Timeout):
            move.wait(-1.0)
        with self.assertRaises(ValueError):
            move.wait(math.nan)
        self.assertEqual(move.wait(math.inf).end, "reached")

    def test_a_bounded_wait_of_real_time_leaves_the_move_alone(self):
        machine = self.opened({"axes": {"x": support.axis()}})
        move = self.held_move(machine)
        for timeout in (0.0, 0.02, 0.12):
            with self.assertRaises(Timeout):
                move.wait(timeout)
        self.assertFalse(move.done)
        machine.resume()
        self.assertEqual(move.wait(math.inf).position, 0.1)

    def test_a_cancelled_move_ends_before_its_target(self):
        move = self.x.move_to(0.05)
        self.machine.advance(0.2)
        move.cancel()
        with self.assertRaises(NotReached) as caught:
            move.wait()
        result = caught.exception.result
        self.assertEqual(str(caught.exception), result.message)
        self.assertEqual(move.wait(check=False), result)
        self.assertIs(result.end, MoveEnd.STOPPED)
        self.assertLess(result.position, 0.05)
        move.cancel()  # it has ended already

    def test_to_cancel_a_move_leaves_the_one_that_replaced_it(self):
        first = self.x.move_to(0.05)
        self.machine.advance(0.2)
        second = self.x.move_to(0.1)
        self.assertIs(first.wait(check=False).end, MoveEnd.REPLACED)
        first.cancel()
        self.assertEqual(second.wait().position, 0.1)

    def test_a_move_that_cannot_stop_in_time_overshoots(self):
        self.x.move_to(0.1)
        self.machine.advance(0.5)
        move = self.x.move_to(0.045)
        self.assertGreater(move.overshoot, 0.0)
        self.assertEqual(move.wait().position, 0.045)

    def test_each_end_has_its_name(self):
        self.x.move_to(0.05).wait()
        move = self.x.move_to(0.1)
        self.machine.advance(0.2)
        self.machine.rig.press_endstop("x", "max")
        self.assertIs(move.wait(check=False).end, MoveEnd.ENDSTOP_MAX)
        self.assertRegex(self.x.state.stopped_by, "^the max endstop was met at ")
        self.machine.rig.press_endstop("x", "max", False)
        move = self.x.move_to(0.0)
        self.machine.advance(0.2)
        self.machine.rig.press_endstop("x", "min")
        self.assertIs(move.wait(check=False).end, MoveEnd.ENDSTOP_MIN)
        self.machine.rig.press_endstop("x", "min", False)
        move = self.x.move_to(0.1)
        self.machine.advance(0.2)
        self.machine.emergency_stop()
        self.assertIs(move.wait(check=False).end, MoveEnd.EMERGENCY_STOP)

    def test_nothing_can_end_the_wait_for_a_held_move(self):
        with self.assertRaisesRegex(Exception, "nothing is under way that could end this wait"):
            self.held_move(self.machine).wait()

    def test_virtual_time_gives_the_same_time_each_time(self):
        times = set()
        for _ in range(3):
            machine = self.opened({"axes": {"x": support.axis()}}, virtual_time=True)
            machine["x"].move_to(0.05).wait()
            machine["x"].move_by(0.01, velocity=0.03).wait()
            times.add(machine.time)
        self.assertEqual(len(times), 1)

    def test_a_fast_rig_needs_no_waiting(self):
        machine = self.opened({"axes": {"x": support.axis()}}, speed=0)
        self.assertEqual(machine["x"].move_to(0.2, velocity=0.001).wait().end, "reached")
        self.assertGreater(machine.time, 200.0)

    def test_objects_say_what_they_are(self):
        move = self.x.move_to(0.05)
        self.assertEqual(repr(move), "<Move of x to 0.05: under way>")
        move.wait()
        self.assertEqual(repr(move), "<Move of x to 0.05: x reached 0.05 m>")
        self.assertEqual(repr(self.x), "<Axis x at 0.05 m>")
        self.assertEqual(repr(self.machine), "<Machine of x on the simulated rig>")
        self.machine.shutdown()
        self.assertEqual(repr(self.x), "<Axis x of a machine that was shut down>")
        self.assertEqual(repr(self.machine), "<Machine of x on the simulated rig, shut down>")


class Plans(support.MachineTest):
    def test_a_plan_moves_nothing(self):
        plan = self.x.plan(0.05)
        self.assertEqual((plan.axis, plan.unit, plan.target, plan.rest, plan.overshoot), ("x", "m", 0.05, 0.05, 0.0))
        self.assertEqual(plan.steps_per_unit, 80000.0)
        self.assertAlmostEqual(sum(piece.duration for piece in plan.pieces), plan.duration, places=6)
        self.machine.advance(1.0)
        self.assertEqual(self.machine.figures.pulses, 0)

    def test_a_plan_has_the_motion_at_each_time(self):
        plan = self.x.plan(0.05)
        self.assertEqual(plan.at(-1.0).position, 0.0)
        self.assertEqual(plan.at(-1.0).velocity, 0.0)
        self.assertAlmostEqual(plan.at(0.1).velocity, 0.05, places=6)
        self.assertAlmostEqual(plan.at(0.1).position, 0.0025, places=6)
        self.assertAlmostEqual(plan.at(0.1).acceleration, 0.5, places=6)
        self.assertAlmostEqual(plan.at(0.35).velocity, 0.1, places=6)
        self.assertAlmostEqual(plan.at(9.0).position, 0.05, places=6)
        times, motions = plan.sample(10)
        self.assertEqual(len(times), len(motions))
        self.assertEqual(times, sorted(times))
        self.assertLessEqual(max(motion.velocity for motion in motions), 0.1 + 1e-9)

    def test_a_relative_plan_counts_from_the_target(self):
        self.x.move_to(0.05).wait()
        self.assertEqual(self.x.plan(0.01, relative=True).target, 0.06)

    def test_a_shaped_plan_is_the_sum_of_its_parts(self):
        shaped = support.axis(input_shaper={"type": "zv", "frequency": 20.0, "damping": 0.0})
        machine = self.opened({"axes": {"x": shaped}}, virtual_time=True)
        plan = machine["x"].plan(0.05)
        self.assertEqual(len(plan.parts), 2)
        self.assertAlmostEqual(sum(part.part for part in plan.parts), 1.0, places=9)
        # ZV: the same motion twice, each time half, half a period of the oscillation apart.
        self.assertAlmostEqual(plan.at(0.01).acceleration, 0.25, places=6)
        self.assertAlmostEqual(plan.at(0.03).acceleration, 0.5, places=6)
        self.assertAlmostEqual(plan.at(9.0).position, 0.05, places=6)
        self.assertAlmostEqual(plan.sample()[0][-1], plan.duration, delta=0.001)

    def test_a_plan_without_a_motion_is_at_rest(self):
        plan = self.x.plan(0.0)
        self.assertEqual(plan.pieces, ())
        self.assertEqual(plan.at(0.5).position, 0.0)

    def test_a_plan_is_drawn_in_two_lines(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("needs matplotlib")
        figure = self.x.plan(0.05).plot()
        labels = [graph.get_ylabel() for graph in figure.axes]
        self.assertEqual(labels, ["position [m]", "velocity [m/s]", "acceleration [m/s^2]"])
        [curve] = figure.axes[1].get_lines()
        self.assertAlmostEqual(max(curve.get_ydata()), 0.1, places=6)
        from matplotlib.figure import Figure

        mine = Figure()
        self.assertIs(self.x.plan(0.05).plot(mine), mine)
        self.assertEqual(len(self.x.plan(0.0).plot().axes), 3)

    def test_the_package_loads_without_matplotlib_and_numpy(self):
        import subprocess
        import sys

        code = "import sys, stepdriver_core; sys.exit('matplotlib' in sys.modules or 'numpy' in sys.modules)"
        self.assertEqual(subprocess.run([sys.executable, "-B", "-c", code], check=False).returncode, 0)


if __name__ == "__main__":
    unittest.main()
