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

    def test_takes_the_levels_that_a_recording_tells(self):
        # It begins in the middle of a pulse, of a motion that goes backward.
        recording = vcd((1, 0), [(10, "a", 0), (20, "a", 1), (22, "a", 0), (30, "b", 1), (40, "a", 1)])
        self.assertEqual(self.trace(recording).counts("x")[1], [1, 2])
        for comments, counts in ((("step active high", "dir active high"), [-1, 0]),
                                 (("step active high", "dir active low"), [1, 0]),
                                 (("step active low", "dir active low"), [1, 2])):
            lines = "".join(f"$comment x.{words} $end\n" for words in comments)
            told = recording.replace("$enddefinitions", lines + "$enddefinitions")
            self.assertEqual(self.trace(told).counts("x")[1], counts, comments)

    def test_counts_the_pulses_of_cw_and_ccw(self):
        text = vcd((0, 0), [(10, "a", 1), (12, "a", 0), (20, "a", 1), (22, "a", 0), (30, "b", 1), (32, "b", 0)])
        trace = self.trace(text.replace("a step", "a cw").replace("b dir", "b ccw"))
        self.assertEqual(trace.axes(), ["x"])
        self.assertEqual(trace.counts("x")[1], [1, 2, 1])
        self.assertEqual(trace.counts("x", False, False)[1], [1, 2, 1])

    def test_counts_the_steps_of_a_motor_whose_coils_are_switched(self):
        def recorded(patterns):
            text = "$timescale 1us $end\n$scope module x $end\n"
            text += "".join(f"$var wire 1 {name} in{i} $end\n" for i, name in enumerate("abcd", 1))
            text += "$upscope $end\n$enddefinitions $end\n"
            for number, pattern in enumerate(patterns):
                text += f"#{10 * number}\n" + "".join(f"{level}{name}\n" for level, name in zip(pattern, "abcd"))
            return self.trace(text)
        half = recorded(["0000", "1100", "0100", "0110", "0100", "0000", "0100", "1100", "1000"])
        self.assertEqual(half.axes(), ["x"])
        self.assertEqual(half.counts("x")[1], [1, 2, 1, 0, -1])
        self.assertAlmostEqual(half.counts("x")[0][-1], 80e-6, delta=1e-12)
        full = recorded(["1100", "0110", "0011", "1001", "1100", "1001"])
        self.assertEqual(full.counts("x")[1], [1, 2, 3, 4, 3])

    def test_counts_each_edge_if_the_file_says_that_it_is_a_step(self):
        text = vcd((0, 1), [(10, "a", 1), (20, "a", 0), (30, "b", 0), (40, "a", 1)])
        told = text.replace("$enddefinitions", "$comment x.step active both $end\n$enddefinitions")
        self.assertEqual(self.trace(told).counts("x")[1], [1, 2, 1])

    def test_passes_over_the_comments_of_others(self):
        text = vcd((0, 1), [(10, "a", 1)])
        for comment in ("$comment $end\n", "$comment\n any words\n$end\n", "$comment a b c d $end\n"):
            self.assertEqual(self.trace(comment + text).counts("x")[1], [1])

    def test_says_where_it_cannot_read_a_file(self):
        for text, words in (("", "isn't a VCD file"),
                            (vcd((0, 1), [(10, "z", 1)]), "line 14: can't be read: 1z"),
                            (vcd((0, 1), []) + "#ten\n", "line 13: can't be read: #ten"),
                            (vcd((0, 1), []).replace("#0\n", "") + "1a\n", "line 12: can't be read: 1a"),
                            (vcd((0, 1), []) + "#9" + "0" * 30, "line 13: can't be read: #9")):
            with self.assertRaises(BadTrace) as caught:
                self.trace(text)
            self.assertIn(words, str(caught.exception))
        with self.assertRaises(BadTrace) as caught:
            PinTrace(self.file.parent / "none.vcd")
        self.assertIn("none.vcd", str(caught.exception))

    def test_refuses_two_steps_at_one_time(self):
        for text in (vcd((0, 1), [(10, "a", 1), (10, "a", 0), (10, "a", 1)]),
                     vcd((0, 1), [(9 * 10**15, "a", 1), (9 * 10**15, "a", 0)]) + "#9000000000000000\n1a\n"):
            with self.assertRaises(BadTrace) as caught:
                self.trace(text).counts("x")
            self.assertIn("has two steps of x at ", str(caught.exception))

    def test_shows_no_character_that_a_terminal_would_obey(self):
        with self.assertRaises(BadTrace) as caught:
            self.trace(vcd((0, 1), []) + "#1\x1b[2J" + "x" * 10000)
        self.assertIn("can't be read: #1\\x1b[2Jxxx", str(caught.exception))
        self.assertLess(len(str(caught.exception)), 600)

    def test_has_no_axis_without_a_level(self):
        self.assertEqual(self.trace(vcd((0, 1), []).replace("0a\n", "").replace("1a\n", "")).axes(), [])


if __name__ == "__main__":
    unittest.main()
