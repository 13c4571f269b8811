"""The command lines of plot_motion, measure_resonance, tune_stall and draw."""

import subprocess
import sys
import unittest

from support import SCRIPTS


class ArgumentsTest(unittest.TestCase):
    def said(self, *words):
        """What a command says of a command line that it can't use."""
        ended = subprocess.run([sys.executable, "-B", str(SCRIPTS / words[0]), *words[1:]], capture_output=True,
                               text=True, check=False)
        self.assertEqual(ended.returncode, 64, ended.stderr)
        return ended.stderr.splitlines()[-1]

    def test_name_an_option_that_does_not_exist(self):
        for words in (["draw", "--bogus"], ["measure_resonance", "--bogus"], ["plot_motion", "--bogus"],
                      ["plot_motion", "plan", "--bogus", "3"], ["draw", "--bogus", "file.svg"]):
            self.assertIn("unrecognized arguments: --bogus", self.said(*words))

    def test_name_what_is_missing(self):
        self.assertIn("required: file", self.said("draw"))
        self.assertIn("required: --axis", self.said("measure_resonance"))
        self.assertIn("required: --axis, --distance", self.said("tune_stall"))
        self.assertIn("required: --axis", self.said("plot_motion", "plan", "--out=plan.svg", "--to", "3"))

    def test_name_what_is_out_of_range(self):
        way = ["tune_stall", "--axis", "x", "--distance"]
        self.assertIn("argument --distance: 0: must not be 0", self.said(*way, "0"))
        for number in ("1", "1001", "2.5", "nan"):
            self.assertIn(f"argument --homings: {number}: must be a", self.said(*way, "-8", "--homings", number))


if __name__ == "__main__":
    unittest.main()
