"""Threads, signals, processes, and the lives of objects."""

import gc
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
import weakref
from pathlib import Path

from stepdriver_core import HomingEnd, Machine, MoveEnd, NotReached, Refused

import support


def in_python(code, folder=None):
    """Runs a program in a Python of its own, and returns what it prints."""
    header = "import os, sys, support\nfrom stepdriver_core import *\n"
    paths = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    ended = subprocess.run([sys.executable, "-B", "-X", "faulthandler", "-c", header + code], cwd=folder, text=True,
                           capture_output=True, check=False, timeout=support.HANGS_AFTER,
                           env={**os.environ, "PYTHONPATH": paths})
    if ended.returncode != 0:
        raise AssertionError(f"exit code {ended.returncode}: {ended.stdout}{ended.stderr}")
    return ended.stdout


class Threads(support.MachineTest):
    def setUp(self):
        super().setUp()
        self.machine = self.opened({"axes": {"x": support.axis()}})
        self.x = self.machine["x"]

    def test_others_run_while_one_waits(self):
        # One call of the compiled part waits for the end of the move: if it kept the interpreter's lock,
        # nobody could count, and nobody could stop the move.
        move = self.held_move(self.machine)
        counted = []

        def count_and_stop():
            support.await_function(waiting, "wait_in_one_call")
            counted.extend(range(10_000))
            self.machine.stop()

        def wait_in_one_call():
            return move._handle.wait(None)

        waiting = threading.get_ident()
        other = support.running(count_and_stop)
        self.assertEqual(wait_in_one_call()["end"], "stopped")
        other.join()
        self.assertEqual(len(counted), 10_000)

    def test_others_run_while_one_homes(self):
        machine = self.opened({"axes": {"x": support.slowly_homed()}})
        axis = machine["x"]
        results = []
        homing = support.running(lambda: results.append(axis.home(check=False)))
        while axis.state.homing == "none" and homing.is_alive():
            pass
        machine.stop()
        homing.join()
        self.assertIs(results[0].end, HomingEnd.FAILED)
        self.assertIn("stopped", results[0].message)

    def test_two_can_wait_for_one_move(self):
        move = self.held_move(self.machine)
        ends = []

        def wait():
            ends.append(move.wait(check=False).end)

        threads = [support.running(wait) for _ in range(2)]
        for thread in threads:
            support.await_function(thread.ident, "wait")
        move.cancel()
        for thread in threads:
            thread.join()
        self.assertEqual(ends, [MoveEnd.STOPPED] * 2)

    def test_many_can_command_one_machine(self):
        errors = []

        def command(number):
            try:
                for i in range(50):
                    self.x.move_to(0.001 * (number + i % 7))
                    self.x.state
                    self.machine.figures
                self.x.stop()
            except Exception as error:  # noqa: BLE001: whatever it is, the test shows it
                errors.append(error)

        threads = [support.running(lambda number=number: command(number)) for number in range(4)]
        for thread in threads:
            thread.join()
        self.assertEqual(errors, [])

    def test_many_can_command_a_machine_in_virtual_time(self):
        machine = self.opened({"axes": {"x": support.axis()}}, virtual_time=True)
        threads = [support.running(lambda: [machine["x"].move_by(1e-4).wait(check=False) for _ in range(20)])
                   for _ in range(4)]
        for thread in threads:
            thread.join()
        self.assertAlmostEqual(machine["x"].position, 80e-4, places=9)

    def test_a_shutdown_answers_who_waits(self):
        move = self.held_move(self.machine)
        errors = []

        def wait():
            try:
                move.wait()
            except NotReached as error:
                errors.append(error)

        waiting = support.running(wait)
        support.await_function(waiting.ident, "wait")
        self.machine.shutdown()
        waiting.join()
        self.assertIs(errors[0].result.end, MoveEnd.STOPPED)
        self.assertIn("the machine was shut down", str(errors[0]))


class Signals(support.MachineTest):
    """Ctrl-C, in the main thread of Python."""

    def interrupted_in(self, name, ready=lambda: True):
        main = threading.main_thread().ident

        def interrupt():
            support.await_function(main, name)
            while not ready():
                pass
            signal.raise_signal(signal.SIGINT) if os.name == "nt" else os.kill(os.getpid(), signal.SIGINT)

        return support.running(interrupt)

    def test_ctrl_c_ends_the_waiting_and_the_block_shuts_down(self):
        with self.assertRaises(KeyboardInterrupt):
            with Machine({"axes": {"x": support.axis()}}, simulated=True) as machine:
                move = self.held_move(machine)
                self.interrupted_in("_await")
                move.wait()
        self.assertFalse(machine.is_open)
        self.assertIs(move.result.end, MoveEnd.STOPPED)

    def test_the_move_continues_without_a_block(self):
        machine = self.opened({"axes": {"x": support.axis()}})
        move = self.held_move(machine)
        with self.assertRaises(KeyboardInterrupt):
            self.interrupted_in("_await")
            move.wait()
        self.assertFalse(move.done)
        machine.resume()
        self.assertEqual(move.wait().position, 0.1)

    def test_ctrl_c_ends_a_homing(self):
        machine = self.opened({"axes": {"x": support.slowly_homed()}})
        homing = lambda: machine["x"].state.homing != "none"  # noqa: E731
        with self.assertRaises(KeyboardInterrupt):
            self.interrupted_in("home", homing)
            machine["x"].home()
        self.assertFalse(machine["x"].state.moving)
        self.assertFalse(machine["x"].state.homed)
        machine["x"].move_by(0.01).wait()

    def test_a_handler_may_command_the_machine(self):
        machine = self.opened({"axes": {"x": support.axis()}})
        before = signal.signal(signal.SIGINT, lambda *_: machine.emergency_stop())
        self.addCleanup(signal.signal, signal.SIGINT, before)
        move = self.held_move(machine)
        self.interrupted_in("_await")
        self.assertIs(move.wait(check=False).end, MoveEnd.EMERGENCY_STOP)


class Lives(support.MachineTest):
    def test_what_was_shut_down_says_so(self):
        move = self.x.move_to(0.05)
        line = self.machine.move_line({"x": 0.01})
        waited = self.x.move_to(0.02)
        self.machine.shutdown()
        self.machine.shutdown()
        self.assertFalse(self.machine.is_open)
        calls = [lambda: self.x.move_to(0.05), lambda: self.x.state, lambda: self.x.position, self.x.enable,
                 lambda: self.x.endstops, lambda: self.x.limits, self.machine.stop, self.machine.home,
                 lambda: self.machine.time, lambda: self.machine.positions, self.machine.emergency_stop, waited.cancel,
                 line.cancel, lambda: line.ahead, lambda: line.append([]), lambda: self.machine.rig.report("x")]
        for call in calls:
            with self.assertRaisesRegex(Refused, "^the machine was shut down$"):
                call()
        self.assertEqual(self.x.name, "x")
        # Moves keep their results.
        self.assertIs(move.wait(check=False).end, MoveEnd.STOPPED)  # a line begins at rest
        self.assertIs(waited.wait(check=False).end, MoveEnd.STOPPED)
        self.assertTrue(line.done)
        self.assertEqual(list(line.wait(check=False).positions), ["x"])

    def test_an_axis_and_a_move_keep_their_machine(self):
        machine = Machine({"axes": {"x": support.axis()}}, simulated=True, virtual_time=True)
        gone = weakref.ref(machine)
        axis = machine["x"]
        move = axis.move_to(0.05)
        del machine
        gc.collect()
        self.assertIsNone(gone())
        self.assertEqual(move.wait().position, 0.05)
        self.assertEqual(axis.position, 0.05)
        del axis
        self.assertEqual(move.result.message, "x reached 0.05 m")

    def test_lines_are_free_after_the_block(self):
        with tempfile.TemporaryDirectory() as folder:
            config = {"axes": {"x": support.axis()}, "state_file": str(Path(folder) / "state.yaml")}
            for _ in range(2):  # the rig of each is its own, but the file has one owner at a time
                with Machine(config, simulated=True) as machine:
                    machine["x"].set_position(0.05)
                    move = machine["x"].move_by(0.001)
                self.assertTrue(move.done)

    def test_an_error_in_the_block_is_not_lost(self):
        with self.assertRaises(ZeroDivisionError):
            with Machine({"axes": {"x": support.axis()}}, simulated=True) as machine:
                machine["x"].jog(0.05)
                1 / 0
        self.assertFalse(machine.is_open)

    def test_machines_leave_nothing(self):
        said = in_python("""
def threads():
    # The system lists a thread for a moment longer than its join() waits.
    for _ in range(10_000):
        if len(os.listdir("/proc/self/task")) == 1:
            break
    return len(os.listdir("/proc/self/task"))

def used():
    with open("/proc/self/statm", encoding="ascii") as file:
        pages = int(file.read().split()[1])
    return (threads(), len(os.listdir("/proc/self/fd")),
            pages * os.sysconf("SC_PAGE_SIZE"))

def open_and_close(times):
    for i in range(times):
        with Machine({"axes": {"x": support.axis()}}, simulated=True) as machine:
            move = machine["x"].move_to(0.05)
            machine["x"].state
        assert move.done

open_and_close(50)
before = used()
open_and_close(150)
after = used()
print(after[0] == 1, before[1] == after[1], (after[2] - before[2]) // 150)
""")
        threads, files, bytes_each = said.split()
        self.assertEqual((threads, files), ("True", "True"))
        self.assertLess(int(bytes_each), 1024, "bytes of memory that each machine has left")

    def test_a_machine_is_shut_down_when_the_program_ends(self):
        with tempfile.TemporaryDirectory() as folder:
            code = f"""
config = {{"axes": {{"x": support.axis()}}, "state_file": {str(Path(folder) / "state.yaml")!r}}}
machine = Machine(config, simulated=True)
"""
            moving = code + 'x = machine["x"]\nx.set_position(0.05)\nx.jog(0.05)\nwhile x.position == 0.05: pass\n'
            note = code + 'print(machine["x"].state.position_note)'
            in_python(moving)
            self.assertIn("the motor had no current in between", in_python(note))
            # What a program leaves that had no time for it.
            in_python(moving + "os._exit(0)")
            self.assertIn("the node that kept this position wasn't shut down", in_python(note))

    def test_the_child_of_a_fork_is_told_and_ends(self):
        said = in_python("""
machine = Machine({"axes": {"x": support.axis()}}, simulated=True)
move = machine["x"].move_to(0.1)
child = os.fork()
if child == 0:
    try:
        machine["x"].move_to(0.05)
    except Refused as error:
        print(error)
    machine.shutdown()
    del machine, move
    sys.exit(0)
assert os.waitpid(child, 0)[1] == 0
print(move.wait().message)
""")
        self.assertIn("the machine belongs to the process that made it", said)
        self.assertIn("x reached 0.1 m", said)

    def test_a_child_can_have_a_machine_of_its_own(self):
        said = in_python("""
machine = Machine({"axes": {"x": support.axis()}}, simulated=True, virtual_time=True)
child = os.fork()
if child == 0:
    with Machine({"axes": {"x": support.axis()}}, simulated=True) as own:
        print(own["x"].move_to(0.01).wait().message)
    sys.exit(0)
assert os.waitpid(child, 0)[1] == 0
""")
        self.assertIn("x reached 0.01 m", said)


class Examples(unittest.TestCase):
    def test_the_blocks_of_the_page_run(self):
        root = Path(__file__).resolve().parents[2]
        page = (root / "docs" / "python.md").read_text(encoding="utf-8")
        blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        self.assertEqual(len(blocks), 4)
        program, moves, picture, own_test = blocks
        opened = 'machine = Machine.from_file("axis.yaml", simulated=True)\nx = machine["x"]\nx.enable()\n'
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(root / "examples" / "move_axis" / "axis.yaml", folder)
            self.assertEqual(in_python(program, folder), "0.05 True\n")
            self.assertRegex(in_python(opened + moves, folder), "^x (stands at|reached) ")
            in_python("from stepdriver_core import Machine\n" + own_test, folder)
            try:
                import matplotlib  # noqa: F401
            except ImportError:
                self.skipTest("needs matplotlib")
            in_python(opened + picture, folder)
            self.assertIn("<svg", (Path(folder) / "plan.svg").read_text(encoding="utf-8"))

    def test_the_example_moves_its_axis(self):
        example = Path(__file__).resolve().parents[2] / "examples" / "python" / "move_axis.py"
        said = subprocess.run([sys.executable, "-B", str(example)], capture_output=True, text=True, check=True).stdout
        self.assertEqual(said, "x reached 0.05 m\nx reached 0 m\n")
        lines = example.read_text(encoding="utf-8").splitlines()
        self.assertLessEqual(len([line for line in lines if line and not line.startswith('"""')]), 10)


if __name__ == "__main__":
    unittest.main()
