"""A picture that can't be written is refused before anything moves or is read."""

import pathlib
import tempfile
import unittest

import support  # noqa: F401: the path to the modules
from stepdriver_plots.errors import Undrawable
from stepdriver_plots.figure import refuse_unwritable


class FilesTest(unittest.TestCase):
    def test_refuses_a_picture_that_cannot_be_written(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "folder.svg").mkdir()
            refuse_unwritable(folder / "drawn.svg")
            self.assertFalse((folder / "drawn.svg").exists())
            (folder / "old.svg").write_text("old")
            refuse_unwritable(folder / "old.svg")
            self.assertEqual((folder / "old.svg").read_text(), "old")
            for path, words in ((folder / "none" / "drawn.svg", "No such file or directory"),
                                (folder / "folder.svg", "isn't a file"),
                                (pathlib.Path("/proc/drawn.svg"), "can't be written: ")):
                with self.assertRaises(Undrawable) as caught:
                    refuse_unwritable(path)
                self.assertIn(words, str(caught.exception))


if __name__ == "__main__":
    unittest.main()
