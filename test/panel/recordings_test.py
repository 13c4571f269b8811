"""Which files of the flight recorder the panel shows and opens."""

import os
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"))
from stepdriver_panel.errors import Refusal  # noqa: E402: the path comes first
from stepdriver_panel.recordings import Recordings  # noqa: E402

NAME = "lab_stepdriver_20260102-030405_17.vcd"


class TheRecordings(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name) / "recordings"
        self.folder.mkdir()
        self.secret = pathlib.Path(folder.name) / "secret"
        self.secret.write_text("secret")
        self.recordings = Recordings(str(self.folder), "/lab/stepdriver")

    def refused(self, name):
        with self.assertRaises(Refusal):
            self.recordings.open(name)

    def test_are_those_of_the_driver(self):
        (self.folder / NAME).write_text("$end")
        (self.folder / NAME.replace("vcd", "txt")).write_text("text")
        for other in ("notes.txt", "stepdriver_20260102-030405_17.vcd", NAME + "~", NAME.replace("vcd", "svg")):
            (self.folder / other).write_text("not shown")
            self.refused(other)
        self.assertEqual(sorted(one["name"] for one in self.recordings.shown()),
                         sorted([NAME, NAME.replace("vcd", "txt")]))
        file, size = self.recordings.open(NAME)
        with file:
            self.assertEqual((file.read(), size), (b"$end", 4))

    def test_no_path_leads_out_of_the_folder(self):
        for name in ("../secret", "/etc/passwd", "", ".", "..", "\0", f"../recordings/{NAME}", f"{NAME}\n", f"./{NAME}"):
            self.refused(name)

    def test_links_pipes_and_folders_are_not_opened(self):
        (self.folder / NAME).symlink_to(self.secret)
        self.refused(NAME)
        pipe = NAME.replace("17", "18")
        os.mkfifo(self.folder / pipe)
        self.refused(pipe)
        folder = NAME.replace("17", "19")
        (self.folder / folder).mkdir()
        self.refused(folder)
        self.assertEqual(self.recordings.shown(), [])

    def test_without_a_folder_there_are_none(self):
        self.assertEqual(Recordings(str(self.folder / "none"), "/stepdriver").shown(), [])
        self.refused(NAME)
