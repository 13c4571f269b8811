"""Latches and probing."""

import unittest

from stepdriver_core import LatchResult, NoContact, ProbeEnd, Refused, Timeout

import support


class Edges(support.MachineTest):
    """A flag from 20 to 30 mm, and a surface at 50 mm."""

    CONFIG = {
        "axes": {"x": support.axis(), "y": support.plain(("GPIO20", "GPIO21", "GPIO16"))},
        "inputs": {
            "flag": {"pin": "GPIO12", "active_level": "low"},
            "probe": {"pin": "GPIO25", "active_level": "low"},
        },
        "simulation": {"inputs": {"flag": {"axis": "x", "from_mm": 20.0, "to_mm": 30.0},
                                  "probe": {"axis": "x", "from_mm": 50.0, "to_mm": 150.0}}},
    }

    def setUp(self):
        super().setUp()
        self.x.set_position(0.0)
        self.y = self.machine["y"]
        self.y.set_position(0.0)

    def test_a_latch_has_the_positions_at_the_first_edge(self):
        latch = self.machine.latch("flag")
        self.assertFalse(latch.done)
        self.assertIsNone(latch.result)
        self.assertIn("waits", repr(latch))
        self.machine.move_line({"x": 0.04, "y": 0.02}).wait()
        result = latch.wait()
        self.assertTrue(result.latched)
        self.assertEqual((result.edges, result.edge.number, result.edge.active), (1, 1, True))
        self.assertAlmostEqual(result.edge.positions["x"], 0.02, delta=0.0125e-3)
        self.assertAlmostEqual(result.edge.positions["y"], 0.01, delta=0.0125e-3)
        self.assertEqual(result.edge.valid, {"x": True, "y": True})
        self.assertTrue(0.0 < result.edge.time < self.machine.time)
        self.assertFalse(result.edge.was_read)
        self.assertEqual([edge.number for edge in latch.edges()], [1])
        self.assertEqual(latch.edges(), [])
        self.machine.shutdown()
        self.assertEqual(latch.result, result)
        self.assertEqual(latch.wait(), result)
        latch.end()

    def test_every_edge_counts_until_the_end(self):
        latch = self.machine.latch("flag", edge="either", every=True, axes=["x"])
        self.x.move_to(0.04).wait()
        self.x.move_to(0.0).wait()
        edges = latch.edges()
        self.assertEqual([edge.active for edge in edges], [True, False, True, False])
        for edge, place in zip(edges, (0.02, 0.03, 0.03, 0.02)):
            self.assertEqual(list(edge.positions), ["x"])
            self.assertAlmostEqual(edge.positions["x"], place, delta=0.0125e-3)
        with self.assertRaisesRegex(Timeout, "^the latch hasn't ended in 0.5 s"):
            latch.wait(0.5)
        latch.end()
        result = latch.wait()
        self.assertIsInstance(result, LatchResult)
        self.assertEqual((result.edges, result.edge.number), (4, 4))

    def test_only_edges_in_the_window_and_of_the_wanted_kind_count(self):
        latch = self.machine.latch("flag", edge="inactive", window=("x", 0.0, 0.025))
        self.x.move_to(0.04).wait()
        self.assertFalse(latch.done)
        self.x.move_to(0.0).wait()
        self.assertAlmostEqual(latch.wait().edge.positions["x"], 0.02, delta=0.0125e-3)

    def test_a_latch_that_cannot_be_is_refused(self):
        for name, arguments in {
            "flap": dict(input="flap"),
            "z": dict(input="flag", axes=["z"]),
            "window": dict(input="flag", window=("x", 0.03, 0.01)),
        }.items():
            with self.assertRaisesRegex(Refused, name):
                self.machine.latch(**arguments)
        with self.assertRaisesRegex(ValueError, "'rising'.*'active', 'inactive' or 'either'"):
            self.machine.latch("flag", edge="rising")

    def test_a_probing_finds_the_contact(self):
        result = self.machine.probe("probe", {"x": 0.06}, velocity=0.02)
        self.assertEqual(result.end, ProbeEnd.CONTACT)
        self.assertTrue(result.succeeded)
        self.assertAlmostEqual(result.contact["x"], 0.05, delta=0.0125e-3)
        self.assertFalse(result.was_read)
        self.assertGreater(result.positions["x"], 0.05)
        self.assertEqual(result.positions["x"], self.x.position)

    def test_a_second_touch_and_the_way_back(self):
        result = self.machine.probe("probe", {"x": 0.06, "y": 0.03}, velocity=0.02, second_velocity=0.002,
                                    back_off=0.003, go_back=True)
        self.assertAlmostEqual(result.contact["x"], 0.05, delta=0.0125e-3)
        self.assertAlmostEqual(self.x.position, result.contact["x"], delta=0.02e-3)
        self.assertAlmostEqual(self.y.position, 0.025, delta=0.02e-3)
        self.x.move_to(0.055).wait()
        away = self.machine.probe("probe", {"x": -0.02}, relative=True, away=True, velocity=0.01)
        self.assertAlmostEqual(away.contact["x"], 0.05, delta=0.0125e-3)

    def test_without_a_contact_it_fails_unless_it_may(self):
        with self.assertRaises(NoContact) as caught:
            self.machine.probe("probe", {"x": 0.04}, velocity=0.05)
        self.assertEqual(caught.exception.result.end, ProbeEnd.NO_CONTACT)
        self.assertIsNone(caught.exception.result.contact)
        self.assertAlmostEqual(self.x.position, 0.04)
        self.assertEqual(str(caught.exception), caught.exception.result.message)
        self.assertFalse(self.machine.probe("probe", {"x": 0.03}, check=False).succeeded)
        self.assertTrue(self.machine.probe("probe", {"x": 0.02}, must=False).succeeded)

    def test_a_probing_in_the_wrong_state_is_refused(self):
        with self.assertRaisesRegex(Refused, "probe"):
            self.machine.probe("probe", {"x": 0.06}, away=True)
        with self.assertRaisesRegex(Refused, "pin"):
            self.machine.probe("pin", {"x": 0.06})
        self.assertEqual(self.x.position, 0.0)


class LostEdges(support.MachineTest):
    """The rig's lines report how a switch closes, but not how it bounces: half a second later it opens for as long."""

    CONFIG = {
        "axes": {"x": support.axis()},
        "inputs": {"flag": {"pin": "GPIO12", "active_level": "low"}},
        "simulation": {"inputs": {"flag": {"axis": "x", "from_mm": 20.0, "to_mm": 60.0, "bounces": 1,
                                           "bounce_ms": 500.0}}},
    }

    def setUp(self):
        super().setUp()
        self.x.set_position(0.0)

    def test_of_a_latch_are_told_of(self):
        latch = self.machine.latch("flag", edge="either", every=True)
        self.x.move_to(0.025).wait()
        self.machine.advance(1.0)
        closed, opened, closed_again = latch.edges()
        self.assertEqual([closed.was_read, opened.was_read, closed_again.was_read], [False, True, True])
        self.assertAlmostEqual(opened.time, closed.time + 0.5, delta=0.011)
        latch.end()
        self.assertTrue(latch.wait().edge.was_read)

    def test_of_a_probing_are_told_of(self):
        self.x.move_to(0.021).wait()
        result = self.machine.probe("flag", {"x": 0.05}, away=True, velocity=0.01)
        self.assertEqual(result.end, ProbeEnd.CONTACT)
        self.assertTrue(result.was_read)
        self.assertIn("the kernel has reported no edge", result.message)


if __name__ == "__main__":
    unittest.main()
