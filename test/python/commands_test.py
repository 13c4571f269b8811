"""All commands of axes and machines but their moves."""

import unittest

from stepdriver_core import (AxisState, ChipState, Error, HomingEnd, MoveEnd, NoSuchAxis, NotHomed, Refused)

import support


class AnAxis(support.MachineTest):
    def test_is_what_its_configuration_says(self):
        self.assertEqual((self.x.name, self.x.unit, self.x.driver), ("x", "m", "A4988"))
        self.assertEqual((self.x.min_position, self.x.max_position, self.x.continuous), (0.0, 0.2, False))

    def test_is_enabled_and_disabled(self):
        self.x.disable()
        self.assertFalse(self.x.state.enabled)
        self.assertFalse(self.machine.rig.report("x").energized)
        with self.assertRaisesRegex(Refused, "^x: disabled; enable it first$"):
            self.x.move_to(0.05)
        self.assertEqual(self.machine.figures.pulses, 0)
        self.x.enable()
        self.assertTrue(self.x.state.enabled)
        self.assertTrue(self.machine.rig.report("x").energized)

    def test_sleeps_and_wakes(self):
        self.x.sleep()
        self.assertTrue(self.x.state.asleep)
        self.assertFalse(self.machine.rig.report("x").energized)
        with self.assertRaises(Refused):
            self.x.move_to(0.05)
        self.x.wake()
        self.assertFalse(self.x.state.asleep)
        self.x.move_to(0.01).wait()
        self.assert_chip_is_well()

    def test_is_reset(self):
        self.x.set_position(0.05)
        self.x.reset()
        self.assertFalse(self.x.state.moving)
        self.x.move_to(0.06).wait()
        self.assert_chip_is_well()

    def test_has_a_position_that_can_be_declared(self):
        self.assertFalse(self.x.state.position_valid)
        self.x.set_position(0.05)
        self.assertEqual(self.x.position, 0.05)
        self.assertTrue(self.x.state.position_valid)
        self.assertEqual(self.machine.figures.pulses, 0)
        with self.assertRaises(Refused):
            self.x.set_position(0.5)
        self.assertEqual(self.x.position, 0.05)

    def test_keeps_its_position_in_another_microstep_mode(self):
        self.x.set_position(0.05)
        self.x.set_microsteps(4)
        self.assertEqual((self.x.state.microsteps, self.x.position), (4, 0.05))
        self.x.move_by(0.01).wait()
        self.assertEqual(self.machine.rig.report("x").pulses_forward, 200)
        with self.assertRaises(Refused):
            self.x.set_microsteps(3)
        self.assert_chip_is_well()

    def test_has_limits_that_can_be_lowered(self):
        limits = self.x.limits
        self.assertEqual((limits.max_speed, limits.acceleration, limits.deceleration, limits.jerk),
                         (0.1, 0.5, 0.5, 0.0))
        self.x.set_limits(max_speed=0.02, jerk=10.0)
        self.assertEqual((self.x.limits.max_speed, self.x.limits.acceleration, self.x.limits.jerk), (0.02, 0.5, 10.0))
        with self.assertRaises(Refused):
            self.x.set_limits(max_speed=0.2)
        with self.assertRaises(Refused):
            self.x.move_to(0.05, velocity=0.05)
        self.x.set_limits()
        self.assertEqual(self.x.limits, limits)

    def test_has_no_chip_to_set_a_current_of(self):
        self.assertEqual(self.machine["x"].state.chips, ())
        with self.assertRaisesRegex(Refused, "its current is set by the board"):
            self.machine["x"].set_current(0.5)

    def test_jogs_until_it_is_stopped(self):
        self.x.jog(0.05)
        self.machine.advance(0.5)
        self.assertAlmostEqual(self.x.state.velocity, 0.05, places=6)
        self.x.jog(0.0)
        self.machine.advance(0.5)
        self.assertFalse(self.x.state.moving)
        self.x.jog(0.05)
        self.machine.advance(0.5)
        self.x.stop()
        self.machine.advance(0.5)
        self.assertFalse(self.x.state.moving)

    def test_does_not_continue_a_stream_of_jogs_after_a_stop(self):
        began = self.x.state.stops
        self.x.jog(0.05, unless_stopped_since=began)
        self.machine.advance(0.2)
        self.x.stop()
        with self.assertRaises(Refused):
            self.x.jog(0.05, unless_stopped_since=began)

    def test_reads_its_switches(self):
        endstops = self.x.endstops
        self.assertEqual((endstops.min, endstops.max), (False, False))
        self.machine.rig.press_endstop("x", "min")
        self.assertIs(self.x.endstops.min, True)
        two = self.opened(support.two_axes(), virtual_time=True)
        self.assertEqual((two["y"].endstops.min, two["y"].endstops.max), (None, None))
        with self.assertRaisesRegex(Refused, "^y has no switch at the max end$"):
            two.rig.press_endstop("y", "max")

    def test_homes(self):
        self.assertFalse(self.x.state.homed)
        result = self.x.home()
        self.assertIs(result.end, HomingEnd.HOMED)
        self.assertEqual((result.axis, result.skew), ("x", 0.0))
        self.assertIn("homed", result.message)
        self.assertTrue(self.x.state.homed)
        self.assertTrue(self.x.state.position_valid)
        self.assert_chip_is_well()

    def test_that_finds_no_switch_is_not_homed(self):
        config = {"axes": {"x": support.axis()}, "simulation": {"axes": {"x": {"min_stuck": "inactive"}}}}
        axis = self.opened(config, virtual_time=True)["x"]
        with self.assertRaises(NotHomed) as caught:
            axis.home()
        [result] = caught.exception.results
        self.assertIs(result.end, HomingEnd.FAILED)
        self.assertEqual(str(caught.exception), result.message)
        self.assertIs(axis.home(check=False).end, HomingEnd.FAILED)
        self.assertFalse(axis.state.homed)

    def test_state_has_each_field(self):
        self.x.move_to(0.05)
        self.machine.advance(0.3)
        state = self.x.state
        self.assertIsInstance(state, AxisState)
        self.assertEqual((state.enabled, state.moving, state.held, state.asleep, state.idle, state.powered),
                         (True, True, False, False, False, True))
        self.assertEqual((state.target, state.homing, state.speed_override), (0.05, "none", 1.0))
        self.assertAlmostEqual(state.time_left, 0.4, delta=0.01)
        self.assertAlmostEqual(state.velocity, 0.1, places=6)
        self.assertEqual((state.fault, state.remedy, state.position_note), ("", "", ""))
        self.assertEqual((state.slack, state.skew, state.brake_engaged), (0.0, 0.0, False))
        self.assertAlmostEqual(state.planned, state.position, delta=0.001)


class AnAxisWithAChipOnAUart(support.MachineTest):
    CONFIG = {"axes": {"x": support.plain(
        ("GPIO17", "GPIO27", "GPIO22"), driver="tmc2209",
        tmc={"port": "/dev/serial0", "address": 0, "sense_resistor_mohm": 110.0, "run_current_a": 0.8})}}

    def test_has_currents_that_can_be_set(self):
        [chip] = self.machine["x"].state.chips
        self.assertIsInstance(chip, ChipState)
        self.assertEqual((chip.motor, chip.is_set_up, chip.at_least_celsius), ("", True, 0))
        self.assertAlmostEqual(chip.run_current, 0.795, delta=0.001)
        self.machine["x"].set_current(0.5, 0.1)
        [chip] = self.machine["x"].state.chips
        self.assertAlmostEqual(chip.run_current, 0.49, delta=0.001)
        self.assertAlmostEqual(chip.hold_current, 0.092, delta=0.001)
        with self.assertRaisesRegex(Refused, "to 0.8 A, its tmc/run_current_a"):
            self.machine["x"].set_current(5.0)
        self.machine["x"].set_current()
        self.assertAlmostEqual(self.machine["x"].state.chips[0].run_current, 0.795, delta=0.001)


class AMachine(support.MachineTest):
    CONFIG = support.two_axes()

    def test_is_a_collection_of_axes(self):
        self.assertEqual(list(self.machine), ["x", "y"])
        self.assertEqual(len(self.machine), 2)
        self.assertIn("x", self.machine)
        self.assertNotIn("z", self.machine)
        self.assertIs(self.machine["x"], self.machine["x"])
        self.assertEqual([axis.name for axis in self.machine.axes], ["x", "y"])
        self.assertEqual(self.machine.positions, {"x": 0.0, "y": 0.0})
        self.assertEqual({name: state.moving for name, state in self.machine.states.items()},
                         {"x": False, "y": False})
        with self.assertRaises(NoSuchAxis) as caught:
            self.machine["z"]
        self.assertEqual(str(caught.exception), "there is no axis z (axes: x, y)")
        self.assertIsInstance(caught.exception, KeyError)

    def test_enables_and_disables_all(self):
        self.machine.disable()
        self.assertEqual([axis.state.enabled for axis in self.machine.axes], [False, False])
        self.machine.enable()
        self.assertEqual([axis.state.enabled for axis in self.machine.axes], [True, True])

    def test_stops_all(self):
        moves = [axis.move_to(0.1) for axis in self.machine.axes]
        self.machine.advance(0.3)
        self.machine.stop()
        self.assertEqual([move.wait(check=False).end for move in moves], [MoveEnd.STOPPED] * 2)

    def test_holds_and_resumes(self):
        move = self.machine["x"].move_to(0.1)
        self.machine.advance(0.3)
        self.machine.hold()
        self.machine.advance(1.0)
        self.assertTrue(self.machine["x"].state.held)
        self.assertFalse(move.done)
        with self.assertRaises(Refused):
            self.machine["y"].move_to(0.05)
        self.machine.resume()
        self.assertEqual(move.wait().position, 0.1)

    def test_scales_velocities(self):
        self.machine.set_speed_override(0.5)
        self.assertEqual(self.machine["x"].state.speed_override, 0.5)
        self.assertAlmostEqual(self.machine["x"].move_to(0.1).wait().duration, 2.1, places=2)
        for wrong in (0.0, 3.0, float("nan")):
            with self.assertRaisesRegex(Refused, "^the speed override is "):
                self.machine.set_speed_override(wrong)

    def test_stops_in_an_emergency_until_it_recovers(self):
        self.machine["x"].move_to(0.1)
        self.machine.advance(0.3)
        self.machine.emergency_stop()
        pulses = self.machine.figures.pulses
        self.assertTrue(self.machine.emergency_stopped)
        state = self.machine["x"].state
        self.assertNotEqual(state.fault, "")
        self.assertNotEqual(state.remedy, "")
        with self.assertRaises(Refused):
            self.machine["y"].move_to(0.05)
        self.machine.advance(1.0)
        self.assertEqual(self.machine.figures.pulses, pulses)
        self.machine.recover()
        self.assertFalse(self.machine.emergency_stopped)
        self.machine["y"].move_to(0.05).wait()

    def test_has_a_button_on_the_rig(self):
        config = dict(support.two_axes(), emergency_stop={"pin": "GPIO25", "active_level": "high"})
        machine = self.opened(config, virtual_time=True)
        machine.rig.press_emergency_stop()
        machine.advance(0.1)
        self.assertTrue(machine.emergency_stopped)
        with self.assertRaises(Refused):
            machine.recover()
        machine.rig.press_emergency_stop(False)
        machine.advance(0.1)
        machine.recover()
        with self.assertRaises(Refused):
            self.machine.rig.press_emergency_stop()

    def test_recovers_all_but_an_axis_whose_chip_is_at_fault(self):
        pins = {"step": "GPIO17", "dir": "GPIO27", "enable": "GPIO22", "fault": "GPIO12"}
        chip = support.axis(driver="drv8825", pins=pins, fault_bias="pull_up")
        config = {"axes": {"x": chip}, "simulation": {"axes": {"x": {"chip_fault_after": 100}}}}
        machine = self.opened(config, virtual_time=True)
        move = machine["x"].move_to(0.1)
        self.assertIs(move.wait(check=False).end, MoveEnd.FAULT)
        self.assertNotEqual(machine["x"].state.fault, "")
        with self.assertRaises(Error):
            machine.recover()

    def test_homes_in_order(self):
        results = self.machine.home()
        self.assertEqual([(result.axis, result.end) for result in results], [("x", HomingEnd.HOMED)])
        self.assertEqual(len(self.machine.home(["x"])), 1)
        with self.assertRaises(Refused):
            self.machine.home(["y"])
        with self.assertRaises(Refused):
            self.machine.home(["z"])

    def test_jogs_axes_together_and_says_which_do_not(self):
        self.assertEqual(self.machine.jog({"x": 0.05, "y": 0.02}), {})
        self.machine.advance(0.3)
        self.assertAlmostEqual(self.machine["y"].state.velocity, 0.02, places=6)
        refused = self.machine.jog({"x": 0.0, "y": 9.0})
        self.assertEqual(list(refused), ["y"])
        self.assertIn("9 m/s", refused["y"])
        began = {"x": self.machine["x"].state.stops}
        self.machine.stop()
        self.assertEqual(list(self.machine.jog({"x": 0.01, "y": 0.01}, unless_stopped_since=began)), ["x"])
        with self.assertRaises(Refused):
            self.machine.jog({"z": 0.01})

    def test_follows_streams(self):
        for i in range(1, 21):
            self.assertEqual(self.machine.follow_positions({"x": 0.001 * i, "y": 0.0005 * i}, timeout=2.0), {})
            self.machine.advance(0.02)
        self.machine.advance(1.0)
        self.assertEqual(self.machine.positions, {"x": 0.02, "y": 0.01})
        self.assertEqual(self.machine.follow_velocities({"x": 0.05}, timeout=0.1), {})
        self.machine.advance(2.0)
        self.assertFalse(self.machine["x"].state.moving)
        self.assertGreater(self.machine["x"].position, 0.02)
        with self.assertRaisesRegex(Refused, "timeout"):
            self.machine.follow_velocities({"x": 0.05}, timeout=100.0)

    def test_time_passes_by_advance_in_virtual_time_only(self):
        began = self.machine.time
        self.machine.advance(1.5)
        self.assertAlmostEqual(self.machine.time - began, 1.5, places=9)
        for wrong in (-1.0, float("nan"), float("inf")):
            with self.assertRaisesRegex(Refused, "^the time to advance by is "):
                self.machine.advance(wrong)
        with self.assertRaises(Refused):
            self.opened(support.two_axes()).advance(1.0)
        with self.assertRaises(ValueError):
            self.opened(support.two_axes(), virtual_time=True, speed=2.0)


if __name__ == "__main__":
    unittest.main()
