"""The panel on a system that has only what the first command installs."""

import os
import pathlib
import subprocess
import sys
import unittest

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"
# The page lacks only drawings without them, and its reader of drawings says which packages to install.
LEFT_OUT = ("matplotlib", "shapely", "svgelements")


def run(code):
    code = f"import sys\nsys.modules.update(dict.fromkeys({LEFT_OUT}))\nsys.path.insert(0, {str(SCRIPTS)!r})\n{code}"
    return subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, timeout=60, check=False,
                          env={**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:1"})


class WithoutThePackagesOfPictures(unittest.TestCase):
    def test_the_panel_starts(self):
        ended = run(f"import runpy\nsys.argv = ['panel']\nrunpy.run_path({str(SCRIPTS / 'panel')!r}, run_name='__main__')")
        self.assertIn("panel: no ROS master answers at http://127.0.0.1:1", ended.stderr)

    def test_every_part_of_the_panel_is_there(self):
        for part in sorted((SCRIPTS / "stepdriver_panel").glob("*.py")):
            ended = run(f"import stepdriver_panel.{part.stem}")
            self.assertEqual((part.name, ended.returncode, ended.stderr), (part.name, 0, ""))


if __name__ == "__main__":
    unittest.main()
