"""The units of the page. The console's test has the same table: test/console/table_units_test.cpp."""

import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "stepdriver_ros/scripts"))
from stepdriver_panel.units import in_page_units, position_text  # noqa: E402: the path comes first


class Units(unittest.TestCase):
    def test_the_numbers_of_the_drivers_texts_are_converted_and_nothing_else(self):
        lines = (ROOT / "test/console/table_units.txt").read_text(encoding="utf-8").splitlines()
        cases = [line.split(" => ") for line in lines if line and not line.startswith("#")]
        self.assertGreaterEqual(len(cases), 15)
        for text, wanted in cases:
            self.assertEqual(in_page_units(text), wanted)
        self.assertEqual(in_page_units(""), "")

    def test_zero_has_no_sign(self):
        self.assertEqual(position_text(-1e-9, "mm"), "0.0000 mm")
