"""Machines for the tests, and a watchdog: a test that hangs ends with the place where it does."""

import faulthandler
import sys
import threading
import unittest

from stepdriver_core import Machine

HANGS_AFTER = 200.0  # [s] less than ctest's limit, and far more than any of these tests takes


def axis(**changes):
    """The configuration of a linear axis, with all pins of an A4988."""
    config = {
        "driver": "a4988",
        "pins": {"step": "GPIO17", "dir": "GPIO27", "enable": "GPIO22", "ms1": "GPIO5", "ms2": "GPIO6",
                 "ms3": "GPIO13", "sleep": "GPIO19", "reset": "GPIO26"},
        "microsteps": 16,
        "steps_per_mm": 80.0,
        "steps_per_round": 3200,
        "max_speed_mm_s": 100.0,
        "acceleration_mm_s2": 500.0,
        "min_position_mm": 0.0,
        "max_position_mm": 200.0,
        "endstops": {"min": {"pin": "GPIO23", "active_level": "high"},
                     "max": {"pin": "GPIO24", "active_level": "high"}},
        "homing": {"switch": "min", "seek_speed_mm_s": 50.0, "latch_speed_mm_s": 5.0, "pull_off_mm": 4.0,
                   "offset_mm": -2.0, "max_travel_mm": 250.0},
        "require_homing": False,
        "enable_on_start": True,
    }
    config.update(changes)
    return {key: value for key, value in config.items() if value is not None}


def slowly_homed():
    """An axis whose homing takes minutes, so that it can't end before a test ends it."""
    homing = axis()["homing"]
    return axis(homing={**homing, "seek_speed_mm_s": 0.02, "latch_speed_mm_s": 0.02})


def plain(pins, **changes):
    """An axis with three pins, and nothing else."""
    names = dict(zip(("step", "dir", "enable"), pins))
    return axis(pins=names, endstops=None, homing=None, **changes)


def two_axes():
    return {"axes": {"x": axis(), "y": plain(("GPIO20", "GPIO21", "GPIO16"))}}


class MachineTest(unittest.TestCase):
    """Each test has a machine in virtual time, unless it asks for another one."""

    CONFIG = None

    def setUp(self):
        faulthandler.dump_traceback_later(HANGS_AFTER, exit=True)
        self.addCleanup(faulthandler.cancel_dump_traceback_later)
        self.machine = self.opened(self.CONFIG or {"axes": {"x": axis()}}, virtual_time=True)
        self.x = self.machine["x"]

    def opened(self, config, **how):
        machine = Machine(config, simulated=True, **how)
        self.addCleanup(machine.shutdown)
        return machine

    def held_move(self, machine, position=0.1):
        """A move that doesn't end by itself, however long this thread has to wait for a processor."""
        machine.set_speed_override(0.01)  # At this speed the move would take minutes.
        move = machine["x"].move_to(position)
        machine.hold()
        machine.set_speed_override(1.0)
        return move

    def assert_chip_is_well(self, machine=None):
        for name in machine or self.machine:
            self.assertEqual((machine or self.machine).rig.report(name).violations, {})


def running(function):
    """Runs a function in a thread, and returns the thread."""
    thread = threading.Thread(target=function, daemon=True)
    thread.start()
    return thread


def await_function(thread_id, name):
    """Returns when this thread of Python is in a function of that name."""
    while True:
        frame = sys._current_frames().get(thread_id)
        while frame is not None:
            if frame.f_code.co_name == name:
                return
            frame = frame.f_back
        threading.Event().wait(0.001)
