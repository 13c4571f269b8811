import importlib
import sys
import unittest
from unittest import mock

import support  # noqa: F401: the path to the modules


class FigureTest(unittest.TestCase):
    def test_says_which_package_it_needs(self):
        # None: as if it were missing.
        with mock.patch.dict(sys.modules, {"matplotlib": None}):
            sys.modules.pop("stepdriver_plots.figure", None)
            with self.assertRaisesRegex(SystemExit, "python3-matplotlib"):
                importlib.import_module("stepdriver_plots.figure")


if __name__ == "__main__":
    unittest.main()
