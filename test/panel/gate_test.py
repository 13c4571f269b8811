"""Who may talk to the panel."""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"))
from stepdriver_panel.gate import Gate, Rate, new_token  # noqa: E402: the path comes first


class TheGate(unittest.TestCase):
    def test_knows_only_its_own_token(self):
        token = new_token()
        gate = Gate(token, "127.0.0.1")
        self.assertTrue(gate.knows_token(token))
        for wrong in ("", token[:-1], token + "x", new_token(), None, 0, [token], {"token": token}, "\ud800"):
            self.assertFalse(gate.knows_token(wrong), wrong)

    def test_tokens_are_long_and_differ(self):
        self.assertGreaterEqual(len(new_token()), 32)
        self.assertNotEqual(new_token(), new_token())

    def test_knows_the_names_of_this_computer(self):
        gate = Gate("t", "127.0.0.1", ["Plotter.lab"])
        for host in ("127.0.0.1:8137", "localhost:9000", "LOCALHOST", "[::1]:8137", "plotter.lab"):
            self.assertTrue(gate.knows_host(host), host)
        for host in ("evil.example", "evil.example:8137", "127.0.0.1.evil.example", "192.168.1.5", "", None, "[", "a b"):
            self.assertFalse(gate.knows_host(host), host)

    def test_on_the_network_addresses_are_known_and_foreign_names_are_not(self):
        gate = Gate("t", "192.168.1.5")
        self.assertTrue(gate.knows_host("192.168.1.5:8137"))
        self.assertTrue(gate.knows_host("[fe80::1]:8137"))
        self.assertFalse(gate.knows_host("rebound.example:8137"))

    def test_only_its_own_page_is_its_origin(self):
        self.assertTrue(Gate.is_own_origin("http://127.0.0.1:8137", "127.0.0.1:8137"))
        self.assertTrue(Gate.is_own_origin("https://plotter.lab", "plotter.lab"))
        for origin in (None, "null", "http://127.0.0.1:9000", "http://evil.example", "http://127.0.0.1:8137.evil.example",
                       "file://", ""):
            self.assertFalse(Gate.is_own_origin(origin, "127.0.0.1:8137"), origin)


class TheRate(unittest.TestCase):
    def test_allows_a_burst_and_then_its_rate(self):
        now = [0.0]
        rate = Rate(10.0, 5, lambda: now[0])
        self.assertEqual([rate.take() for _ in range(6)], [True] * 5 + [False])
        now[0] += 0.1
        self.assertEqual([rate.take() for _ in range(2)], [True, False])
        now[0] += 1000.0
        self.assertEqual([rate.take() for _ in range(6)], [True] * 5 + [False])
