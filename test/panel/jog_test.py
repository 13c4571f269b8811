"""The jog by press and hold, on a clock of the test's own."""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"))
from stepdriver_panel.jog import HeldJog  # noqa: E402: the path comes first


class AHeldJog(unittest.TestCase):
    def setUp(self):
        self.sent = []
        self.jog = HeldJog(lambda axis, velocity: self.sent.append((axis, velocity)), 0.5)

    def press(self, seen, now, press=1, viewer="page", axis="x"):
        return self.jog.press(viewer, press, axis, 0.01, seen, now)

    def test_passes_each_message_on(self):
        self.assertTrue(self.press(10.0, 10.1))
        self.assertTrue(self.press(10.05, 10.14))
        self.assertEqual(self.sent, [("x", 0.01), ("x", 0.01)])

    def test_lasts_for_the_timeout_after_the_update_that_the_page_has_seen(self):
        self.press(10.0, 10.3)
        self.assertEqual(self.jog.until, 10.5)

    def test_an_update_of_the_future_prolongs_nothing(self):
        self.press(99.0, 10.0)
        self.assertEqual(self.jog.until, 10.5)

    def test_late_messages_move_nothing_and_end_it(self):
        self.press(10.0, 10.1)
        self.assertFalse(self.press(10.1, 10.6))
        self.assertEqual(self.sent[-1], ("x", 0.0))
        self.assertFalse(self.press(10.55, 10.6), "the same press has ended")
        self.assertEqual(len(self.sent), 2)

    def test_late_messages_of_a_new_press_move_nothing(self):
        self.assertFalse(self.press(10.0, 11.0))
        self.assertEqual(self.sent, [])

    def test_begins_again_only_with_a_new_press(self):
        self.press(10.0, 10.0)
        self.jog.end()
        self.assertFalse(self.press(10.1, 10.1))
        self.assertTrue(self.press(10.2, 10.2, press=2))
        self.assertFalse(self.press(10.2, 10.2, press=1), "an old press")
        self.assertEqual(self.sent, [("x", 0.01), ("x", 0.0), ("x", 0.01), ("x", 0.0)])

    def test_another_axis_ends_the_first(self):
        self.press(10.0, 10.0)
        self.press(10.0, 10.0, press=2, axis="y")
        self.assertEqual(self.sent, [("x", 0.01), ("x", 0.0), ("y", 0.01)])

    def test_only_its_own_page_ends_it(self):
        self.press(10.0, 10.0)
        self.jog.end("another page")
        self.assertEqual(len(self.sent), 1)
        self.jog.forget("page")
        self.assertEqual(self.sent[-1], ("x", 0.0))
