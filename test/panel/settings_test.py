"""The panel's own parameters."""

import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "stepdriver_ros/scripts"))
from stepdriver_panel.errors import Refusal  # noqa: E402: the path comes first
from stepdriver_panel.settings import DEFAULTS, settings_of  # noqa: E402


class Settings(unittest.TestCase):
    def test_have_defaults(self):
        self.assertEqual(settings_of({}), DEFAULTS)
        self.assertEqual(settings_of({"port": 0, "hosts": ["plotter.lab"]})["port"], 0)

    def test_are_those_of_the_page(self):
        page = (ROOT / "docs/parameters.md").read_text(encoding="utf-8").partition("## The panel\n")[2]
        said = [[cell.strip(" `") for cell in line.split("|")[1:4]] for line in page.splitlines() if line.startswith("| `")]
        self.assertEqual({key: default for key, _, default in said}, {key: str(value) for key, value in DEFAULTS.items()})

    def test_a_wrong_one_is_refused_with_its_name_its_value_and_what_is_allowed(self):
        for wrong, words in (({"port": 65536}, "port is 65536, but must be an integer from 0 to 65535"),
                             ({"port": -1}, "port is -1"), ({"port": "80"}, "port is '80'"), ({"port": True}, "port is True"),
                             ({"listen": ""}, "listen is ''"), ({"driver": 3}, "driver is 3"), ({"driver": " a"}, "driver is"),
                             ({"hosts": "a"}, "hosts is 'a', but must be a list of names"), ({"hosts": [1]}, "hosts is [1]"),
                             ({"prot": 80}, "prot: there is no such parameter (parameters: driver, listen, port, hosts)"),
                             ([], "must be a map")):
            with self.assertRaises(Refusal) as refused:
                settings_of(wrong)
            self.assertIn(words, str(refused.exception))
