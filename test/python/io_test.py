"""Outputs and inputs with a name."""

import unittest

from stepdriver_core import Error, InputState, OutputState, Refused, line

import support


class OutputsAndInputs(support.MachineTest):
    CONFIG = {
        "axes": {"x": support.axis()},
        "outputs": {"pen": {"pin": "GPIO20", "min_off_ms": 50.0}, "lamp": {"pin": "GPIO21"}},
        "inputs": {"paper": {"pin": "GPIO16", "active_level": "low", "debounce_ms": 5.0}},
    }

    def test_have_their_states_by_name(self):
        off = OutputState(on=False, value=0.0, changed=None, note="", error="", axis="", compared=0, missed=0)
        self.assertEqual(self.machine.outputs, {"lamp": off, "pen": off})
        self.assertEqual(self.machine.inputs, {"paper": InputState(active=False, changed=None, error="")})

    def test_an_output_is_switched_when_the_call_returns(self):
        self.machine.set_output("pen", True)
        pen = self.machine.outputs["pen"]
        self.assertTrue(pen.on)
        self.assertLessEqual(pen.changed, self.machine.time)
        self.assertFalse(self.machine.outputs["lamp"].on)
        self.machine.set_output("pen", False)
        switched_off = self.machine.outputs["pen"].changed
        self.machine.set_output("pen", True)
        self.assertGreaterEqual(self.machine.outputs["pen"].changed - switched_off, 0.05)

    def test_an_output_is_safe_from_an_emergency_stop_on(self):
        self.machine.set_output("pen", True)
        self.machine.emergency_stop()
        self.assertFalse(self.machine.outputs["pen"].on)
        with self.assertRaises(Refused):
            self.machine.set_output("pen", True)
        self.machine.recover()
        self.assertFalse(self.machine.outputs["pen"].on)
        self.machine.set_output("pen", True)
        self.assertTrue(self.machine.outputs["pen"].on)

    def test_an_input_follows_its_line(self):
        before = self.machine.time
        self.machine.rig.press_input("paper")
        self.machine.advance(0.02)
        paper = self.machine.inputs["paper"]
        self.assertTrue(paper.active)
        self.assertGreaterEqual(paper.changed, before)
        self.machine.rig.press_input("paper", False)
        self.machine.advance(0.02)
        self.assertFalse(self.machine.inputs["paper"].active)

    def test_a_path_switches_outputs_where_its_segments_begin(self):
        pen = self.machine.outputs["pen"]
        self.assertFalse(pen.on)
        move = self.machine.follow_path(
            ["x"], [line([0.01]), line([0.05], outputs={"pen": True}), line([0.06], outputs={"pen": False})],
            tolerance=1e-4, leads={"pen": (0.01, 0.0)})
        self.machine.advance(0.4)
        self.assertTrue(self.machine.outputs["pen"].on)
        self.assertTrue(0.01 < self.machine["x"].position < 0.05)
        self.assertTrue(move.wait().message)
        self.assertFalse(self.machine.outputs["pen"].on)
        for outputs, leads in (({"pan": True}, {}), ({"pen": True}, {"pen": (11.0, 0.0)})):
            with self.assertRaisesRegex(Refused, "pan|pen"):
                self.machine.follow_path(["x"], [line([0.07], outputs=outputs)], leads=leads)

    def test_a_path_switches_outputs_at_distances_along_its_segments(self):
        self.machine.follow_path(["x"], [line([0.05], outputs=[("lamp", False, 0.04), ("lamp", True, 0.01)])]).wait()
        self.assertFalse(self.machine.outputs["lamp"].on)
        self.assertIsNotNone(self.machine.outputs["lamp"].changed)
        with self.assertRaisesRegex(Refused, "at 0.03 m or rad, but must do so at 0 to 0.02, its length"):
            self.machine.follow_path(["x"], [line([0.07], outputs=[("lamp", True, 0.03)])])

    def test_the_position_of_an_axis_switches_an_output(self):
        x = self.machine["x"]
        x.set_position(0.0)
        self.machine.set_position_compare("lamp", "x", every=(0.002, 0.01, 0.02), pulse=0.001)
        x.move_to(0.05).wait()
        lamp = self.machine.outputs["lamp"]
        self.assertEqual((lamp.axis, lamp.compared, lamp.missed), ("x", 6, 0))
        self.machine.set_position_compare("lamp", "x", cams=[(0.01, 0.03)], direction="down", lead_on=0.001)
        x.move_to(0.02).wait()
        self.assertTrue(self.machine.outputs["lamp"].on)
        self.machine.clear_position_compare("lamp")
        lamp = self.machine.outputs["lamp"]
        self.assertEqual((lamp.axis, lamp.on), ("", False))

    def test_a_position_switches_only_what_it_can(self):
        refused = {
            "pan": dict(output="pan", axis="x", places=[0.01], pulse=0.001),
            "y": dict(output="lamp", axis="y", places=[0.01], pulse=0.001),
            "cam": dict(output="lamp", axis="x", cams=[(0.03, 0.01)]),
            "pulse": dict(output="lamp", axis="x", places=[0.01], pulse=float("nan")),
            "lead_on": dict(output="lamp", axis="x", cams=[(0.01, 0.02)], lead_on=11.0),
        }
        for name, arguments in refused.items():
            with self.assertRaisesRegex(Refused, name):
                self.machine.set_position_compare(**arguments)
        with self.assertRaisesRegex(ValueError, "'left'.*'both', 'up' or 'down'"):
            self.machine.set_position_compare("lamp", "x", places=[0.01], pulse=0.001, direction="left")
        self.assertEqual(self.machine.outputs["lamp"].axis, "")

    def test_unknown_names_are_refused(self):
        with self.assertRaisesRegex(Refused, r"^there is no output pan \(outputs: .*pen.*\)$"):
            self.machine.set_output("pan", True)
        with self.assertRaisesRegex(Refused, "the value 0.5 is one of a PWM output, and this is none"):
            self.machine.set_output("pen", 0.5)
        with self.assertRaisesRegex(Error, "pepper"):
            self.machine.rig.press_input("pepper")


class NoLinesWithAName(support.MachineTest):
    def test_are_empty(self):
        self.assertEqual((self.machine.outputs, self.machine.inputs), ({}, {}))
        with self.assertRaisesRegex(Refused, "none is configured"):
            self.machine.set_output("pen", True)


if __name__ == "__main__":
    unittest.main()
