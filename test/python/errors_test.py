"""What is wrong is said, and nothing moves."""

import os
import pickle
import tempfile
import unittest
from pathlib import Path

import stepdriver_core
from stepdriver_core import ConfigError, Error, GpioError, Machine, Refused

import support


class Configurations(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "machine.yaml"

    def written(self, text):
        self.path.write_text(text, encoding="utf-8")
        return self.path

    def test_all_mistakes_are_told_at_once(self):
        text = "axes: {x: {driver: a4989, microsteps: 3, steps_per_mm: -1.0, max_speed_mm_s: fast}}"
        for open_it in (lambda: Machine.from_file(self.written(text), simulated=True),
                        lambda: Machine.from_file(str(self.written(text)), virtual_time=True, simulated=True)):
            with self.assertRaises(ConfigError) as caught:
                open_it()
            issues = caught.exception.issues
            self.assertGreater(len(issues), 4)
            self.assertIn("axes/x/driver", [issue.key for issue in issues])
            self.assertEqual(str(caught.exception), "\n".join(f"{issue.key}: {issue.message}" for issue in issues))

    def test_a_dict_is_read_as_strictly_as_a_file(self):
        for changes, key in (
            ({"microsteps": 16.0}, "axes/x/microsteps"),
            ({"microsteps": 2**70}, "axes/x/microsteps"),
            ({"microsteps": True}, "axes/x/microsteps"),
            ({"steps_per_mm": float("nan")}, "axes/x/steps_per_mm"),
            ({"pins": {"step": 17}}, "axes/x/pins/step"),
            ({"pins": ["GPIO17"]}, "axes/x/pins"),
            ({"unknown": None}, "axes/x/unknown"),
            ({"speed": 1}, "axes/x/speed"),
        ):
            with self.assertRaises(ConfigError) as caught:
                Machine({"axes": {"x": support.axis(**changes) | changes}}, simulated=True)
            self.assertIn(key, str(caught.exception))

    def test_what_is_no_configuration_is_a_type_error_with_its_key(self):
        with self.assertRaisesRegex(TypeError, "^'axes/x/microsteps' is a complex, but must be a dict, a list, "):
            Machine({"axes": {"x": support.axis(microsteps=3j)}})
        with self.assertRaisesRegex(TypeError, "^7 is a key in 'axes', but keys must be strings$"):
            Machine({"axes": {7: support.axis()}})
        with self.assertRaises(TypeError):
            Machine(7)

    def test_a_file_that_is_no_yaml_is_told_with_its_place(self):
        with self.assertRaisesRegex(Error, r"machine\.yaml:1:\d+: "):
            Machine.from_file(self.written("axes: {x: ["))
        with self.assertRaisesRegex(Error, "can't be read: No such file or directory"):
            Machine.from_file(self.path.parent / "none.yaml")
        with self.assertRaises(Error):
            Machine.from_file(self.path.parent)

    def test_the_speed_of_the_rig_is_checked(self):
        for wrong in (-1.0, float("nan"), float("inf")):
            with self.assertRaisesRegex(ConfigError, "simulation/speed"):
                Machine({"axes": {"x": support.axis()}}, simulated=True, speed=wrong)
        # What stands there and isn't a map stays an issue.
        with self.assertRaisesRegex(ConfigError, "simulation"):
            Machine({"axes": {"x": support.axis()}, "simulation": 3}, simulated=True, speed=1.0)

    def test_real_lines_that_are_not_there_are_named(self):
        config = {"axes": {"x": support.axis(pins={"step": "no_chip:17", "dir": "no_chip:27", "enable": "no_chip:22"})}}
        with self.assertRaisesRegex(GpioError, "no_chip"):
            Machine(config, simulated=False)
        with self.assertRaisesRegex(Refused, "^virtual time needs the simulated rig"):
            Machine(config, simulated=False, virtual_time=True)

    def test_a_rig_writes_its_trace(self):
        trace = self.path.with_suffix(".vcd")
        with Machine({"axes": {"x": support.axis()}}, simulated=True, virtual_time=True, trace=trace) as machine:
            machine["x"].move_to(0.001).wait()
        self.assertIn("$enddefinitions", trace.read_text(encoding="utf-8"))
        with self.assertRaisesRegex(ConfigError, "simulation/trace"):
            Machine({"axes": {"x": support.axis()}}, simulated=True, trace=self.path.parent / "none" / "x.vcd")

    def test_a_state_file_that_cannot_be_written_is_told_and_the_machine_is_shut_down(self):
        folder = self.path.parent / "states"
        folder.mkdir()
        config = {"axes": {"x": support.axis()}, "state_file": str(folder / "state.yaml")}
        machine = Machine(config, simulated=True, virtual_time=True)
        for file in folder.iterdir():
            file.unlink()
        folder.rmdir()
        with self.assertRaisesRegex(stepdriver_core.StateFileError, "state.yaml"):
            machine.shutdown()
        self.assertFalse(machine.is_open)
        machine.shutdown()


class Values(support.MachineTest):
    def test_wrong_values_are_refused_and_nothing_moves(self):
        refused = [
            lambda: self.x.move_to(0.5),
            lambda: self.x.move_to(float("nan")),
            lambda: self.x.move_by(float("inf")),
            lambda: self.x.move_to(0.05, velocity=-1.0),
            lambda: self.x.move_to(0.05, velocity=9.0),
            lambda: self.x.move_to(0.05, velocity=float("nan")),
            lambda: self.x.jog(float("nan")),
            lambda: self.x.jog(9.0),
            lambda: self.x.move_rounds(1e300),
            lambda: self.x.plan(0.5),
            lambda: self.x.set_position(float("nan")),
            lambda: self.x.set_limits(acceleration=-1.0),
            lambda: self.x.set_limits(max_speed=float("nan")),
        ]
        for call in refused:
            with self.assertRaises(Refused) as caught:
                call()
            self.assertRegex(str(caught.exception), "^x: ")
        for call in (lambda: self.x.move_to("0.05"), lambda: self.x.move_to(None), lambda: self.x.move_to([0.05]),
                     lambda: self.x.set_microsteps(1.5), lambda: self.x.set_microsteps(2**40),
                     lambda: self.x.jog(0.01, unless_stopped_since=-1)):
            with self.assertRaises(TypeError):
                call()
        with self.assertRaises(ValueError):
            self.machine.rig.press_endstop("x", "middle")
        with self.assertRaises(Refused):
            self.machine.rig.press_endstop("z", "min")
        with self.assertRaises(Refused):
            self.machine.rig.report("z")
        self.assertEqual(self.machine.figures.pulses, 0)

    def test_each_error_is_an_error_of_this_package(self):
        kinds = [value for value in vars(stepdriver_core).values()
                 if isinstance(value, type) and issubclass(value, Exception)]
        self.assertEqual(len(kinds), 10)
        for kind in kinds:
            self.assertTrue(issubclass(kind, Error))
            self.assertFalse(issubclass(kind, RuntimeError))
            self.assertEqual(kind.__module__, "stepdriver_core")

    def test_errors_and_results_can_be_sent_to_another_process(self):
        with self.assertRaises(Refused) as caught:
            self.x.move_to(0.5)
        self.assertEqual(str(pickle.loads(pickle.dumps(caught.exception))), str(caught.exception))
        with self.assertRaises(ConfigError) as caught:
            Machine({"axes": {"x": {}}}, simulated=True)
        again = pickle.loads(pickle.dumps(caught.exception))
        self.assertEqual((str(again), again.issues), (str(caught.exception), caught.exception.issues))
        result = self.x.move_to(0.01).wait()
        self.assertEqual(pickle.loads(pickle.dumps(result)), result)


class Pages(unittest.TestCase):
    def test_everything_has_words(self):
        for name in stepdriver_core.__all__:
            value = getattr(stepdriver_core, name)
            if name.startswith("__") or name == "Segment":
                continue
            self.assertTrue(value.__doc__, name)
            for member, own in vars(value).items() if isinstance(value, type) else ():
                is_call = callable(own) or isinstance(own, (property, classmethod))
                if is_call and not member.startswith("_") and value.__module__ == "stepdriver_core":
                    words = own.fget.__doc__ if isinstance(own, property) else getattr(value, member).__doc__
                    self.assertTrue(words, f"{name}.{member}")

    def test_the_package_says_that_it_is_typed(self):
        self.assertTrue(os.path.exists(os.path.join(os.path.dirname(stepdriver_core.__file__), "py.typed")))
        self.assertRegex(stepdriver_core.__version__, r"^\d+\.\d+\.\d+$")


if __name__ == "__main__":
    unittest.main()
