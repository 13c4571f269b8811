import pathlib
import tempfile
import unittest

from support import vcd
from stepdriver_plots.errors import BadTrace
from stepdriver_plots.vcd import PinTrace


class PinTraceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "pins.vcd"

    def trace(self, text):
        self.file.write_text(text)
        return PinTrace(self.file)

    def test_counts_steps_forward_and_backward(self):
        trace = self.trace(vcd((0, 1), [(10, "a", 1), (12, "a", 0), (20, "a", 1), (22, "a", 0),
                                        (30, "b", 0), (40, "a", 1), (42, "a", 0)]))
        self.assertEqual(trace.axes(), ["x"])
        times, counts = trace.counts("x")
        self.assertEqual(counts, [1, 2, 1])
        for time, wanted in zip(times, (10e-6, 20e-6, 40e-6)):
            self.assertAlmostEqual(time, wanted, delta=1e-12)

    def test_reads_common_anode_by_the_level_at_rest(self):
        trace = self.trace(vcd((1, 0), [(10, "a", 0), (12, "a", 1), (20, "b", 1), (30, "a", 0)]))
        times, counts = trace.counts("x")
        self.assertEqual(counts, [1, 0])
        self.assertAlmostEqual(times[0], 10e-6, delta=1e-12)

    def test_takes_the_wiring_that_it_is_told(self):
        trace = self.trace(vcd((0, 1), [(10, "a", 1), (12, "a", 0)]))
        self.assertEqual(trace.counts("x", False, True)[1], [-1])
        self.assertAlmostEqual(trace.counts("x", True, False)[0][0], 12e-6, delta=1e-12)

    def test_says_where_it_cannot_read_a_file(self):
        for text, words in (("", "isn't a VCD file"),
                            (vcd((0, 1), [(10, "z", 1)]), "line 14: can't be read: 1z"),
                            (vcd((0, 1), []) + "#ten\n", "line 13: can't be read: #ten"),
                            (vcd((0, 1), []) + "#9" + "0" * 30, "line 13: can't be read: #9")):
            with self.assertRaises(BadTrace) as caught:
                self.trace(text)
            self.assertIn(words, str(caught.exception))
        with self.assertRaises(BadTrace) as caught:
            PinTrace(self.file.parent / "none.vcd")
        self.assertIn("none.vcd", str(caught.exception))

    def test_has_no_axis_without_a_level(self):
        self.assertEqual(self.trace(vcd((0, 1), []).replace("0a\n", "").replace("1a\n", "")).axes(), [])


if __name__ == "__main__":
    unittest.main()
