import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import rosbag
from sensor_msgs.msg import JointState

import support

PROGRAM = support.SCRIPTS / "plot_motion"


class BagTest(unittest.TestCase):
    """Runs the program itself, as it reads a bag with ROS's own library."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bag = pathlib.Path(folder.name) / "moves.bag"
        self.picture = pathlib.Path(folder.name) / "moves.svg"
        with rosbag.Bag(str(self.bag), "w") as bag:
            for i in range(51):
                time = genpy.Time(100, 20000000 * i)
                message = JointState(name=["x_joint"], position=[0.05 * i * 0.02], velocity=[0.05])
                message.header.stamp = time
                bag.write("/joint_states", message, time)

    def draw(self, *arguments):
        done = subprocess.run([sys.executable, "-B", PROGRAM, "bag", self.bag, "-o", self.picture,
                               *arguments], capture_output=True, text=True, check=False)
        return done.returncode, done.stderr

    def test_draws_joint_states_in_millimetres(self):
        self.assertEqual(self.draw("--steps-per-mm", "80"), (0, ""))
        self.assertIn("velocity [mm/s]", self.picture.read_text())
        self.assertNotIn("need the steps per unit", self.picture.read_text())

    def test_says_what_it_needs_for_the_step_period(self):
        self.assertEqual(self.draw(), (0, ""))
        self.assertIn("need the steps per unit", self.picture.read_text())

    def test_says_what_the_bag_lacks(self):
        for arguments, words in ((["--joint", "y_joint"], "no joint y_joint; it has: x_joint"),
                                 (["--topic", "/nothing"], "no motion of at least 4 samples"),
                                 (["--from", "5"], "no motion of at least 4 samples")):
            code, error = self.draw(*arguments)
            self.assertEqual(code, 1)
            self.assertIn(words, error)
        whole = self.bag.read_bytes()
        self.bag.write_text("no bag")
        code, error = self.draw()
        self.assertEqual(code, 1)
        self.assertIn("can't be read as a bag", error)
        # The last one has messages whose number of positions is wrong.
        for noise in (bytes(range(255, -1, -1)) * 40, b"#ROSBAG V2.0\n" + bytes(range(256)) * 40,
                      whole.replace(b"x_joint\x01\x00", b"x_joint\xff\x00")):
            self.bag.write_bytes(noise)
            code, error = self.draw()
            self.assertEqual((code, len(error.splitlines())), (1, 1), error)


if __name__ == "__main__":
    unittest.main()
