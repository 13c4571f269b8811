"""What the page shows of the driver, in its units."""

import math
import time

from stepdriver.msg import Endstops

from .driver import LATENESS, Axis
from .units import in_page_units

STALE_AFTER = 1.0  # [s] the driver publishes its states ten times a second


def output_words(on, value):
    """The state of an output, as the console shows it: "off", "on" or, of a PWM output in part, "on at 0.25"."""
    rounded = f"{value:.3g}"
    return "off" if not on else "on" if rounded == "1" else f"on at {rounded}"


class Machine:
    def __init__(self, driver):
        self.driver = driver
        self.axes = {}  # by name, in the driver's order
        self.jog_timeout = 0.5
        self.recorder = {}
        self._source, self._states = None, []
        self._io_source, self._io = None, {"outputs": [], "inputs": []}
        self._chip_sources, self._chips = {}, {}

    def age(self):
        """[s] of the newest state; infinite if there is none."""
        return time.monotonic() - self.driver.states.at

    @property
    def live(self):
        return self.age() <= STALE_AFTER

    def configure(self, parameters):
        """parameters: the driver's."""
        axes = parameters.get("axes", {})
        names = self.driver.states.message.name if self.driver.states.message is not None else sorted(axes)
        self.axes = {name: Axis(name, axes[name]) for name in names if name in axes}
        self.jog_timeout = parameters.get("jog_timeout", 0.5)
        self.recorder = parameters.get("recorder", {})

    def settings(self):
        return {"driver": self.driver.name, "jogTimeout": self.jog_timeout,
                "axes": [axis.shown() for axis in self.axes.values()]}

    def states(self):
        """The states of the axes; the same object as before if no message has come."""
        message, endstops = self.driver.states.message, self.driver.endstops.message
        if message is None or not self.axes:
            return []
        source = (message, endstops, self.axes)
        if self._source is None or any(now is not then for now, then in zip(source, self._source)):
            self._source = source
            self._states = [self._state(message, endstops, i, name) for i, name in enumerate(message.name)
                            if name in self.axes]
        return self._states

    def _state(self, message, endstops, i, name):
        axis = self.axes[name]
        number = endstops.name.index(name) if endstops is not None and name in endstops.name else None
        switches = {end: None if number is None or not there else self._switch(getattr(endstops, end)[number])
                    for end, there in axis.switches.items()}
        return {
            "name": name, "enabled": message.enabled[i], "moving": message.moving[i], "held": message.held[i],
            "homed": message.homed[i], "valid": message.position_valid[i], "motor": message.motor[i],
            "state": message.state[i], "fault": in_page_units(message.fault[i]),
            "remedy": in_page_units(message.remedy[i]), "note": in_page_units(message.position_note[i]),
            "target": message.target[i] * axis.factor, "stoppedBy": in_page_units(message.stopped_by[i]),
            "min": switches["min"], "max": switches["max"]}

    @staticmethod
    def _switch(active):
        return {"active": active, "text": Endstops.PRESSED if active else Endstops.OPEN}

    def io(self):
        """The outputs and inputs with a name; the same object as before if no message has come. A change is a
        monotonic time, as the tick of an update is, so that the page can tell how long ago it was."""
        if self.driver.io.message is not None and self.driver.io.message is not self._io_source:
            self._io_source = self.driver.io.message
            message, to_monotonic = self._io_source

            def changed(stamp):
                return None if stamp.is_zero() else round(stamp.to_sec() + to_monotonic, 3)
            self._io = {
                "outputs": [{"name": name, "on": on, "words": output_words(on, value), "changed": changed(stamp),
                             "note": in_page_units(note), "error": error}
                            for name, on, value, stamp, note, error in zip(
                                message.output_name, message.output_on, message.output_value, message.output_changed,
                                message.output_note, message.output_error)],
                "inputs": [{"name": name, "active": active, "changed": changed(stamp), "error": error}
                           for name, active, stamp, error in zip(
                               message.input_name, message.input_active, message.input_changed,
                               message.input_error)]}
        return self._io

    def chips(self):
        """What the driver chips on a UART say, by axis: a list with one for each motor. The same object as before
        if no message has come."""
        sources = {axis: newest.message for axis, newest in self.driver.chips.items() if newest.message is not None}
        if sources.keys() != self._chip_sources.keys() or any(
                message is not self._chip_sources[axis] for axis, message in sources.items()):
            self._chip_sources = sources
            self._chips = {axis: [self._chip(message, i) for i in range(len(message.motor))]
                           for axis, message in sources.items()}
        return self._chips

    @staticmethod
    def _chip(message, i):
        return {"motor": message.motor[i], "setUp": message.set_up[i],
                "run": round(message.run_current[i], 3), "hold": round(message.hold_current[i], 3),
                "present": round(message.present_current[i], 3), "celsius": message.at_least_celsius[i],
                "hot": message.temperature_warning[i],
                "load": None if message.load[i] < 0.0 else round(message.load[i], 2)}

    def override(self):
        message = self.driver.states.message
        return message.speed_override if message is not None else None

    def positions(self):
        """[position, velocity] of each axis, counted from the pulses that went out."""
        message = self.driver.joints.message
        if message is None:
            return []
        numbers = {joint: i for i, joint in enumerate(message.name)}
        return [[round(message.position[numbers[axis.joint]] * axis.factor, 6),
                 round(message.velocity[numbers[axis.joint]] * axis.factor, 4)]
                if axis.joint in numbers else None for axis in self.axes.values()]

    def way(self, names):
        """The positions of some axes since the last call, as the pulses made them."""
        axes = [self.axes[name] for name in names if name in self.axes]
        points = []
        for message in self.driver.joints.taken():
            numbers = {joint: i for i, joint in enumerate(message.name)}
            if all(axis.joint in numbers for axis in axes):
                points.append([round(message.position[numbers[axis.joint]] * axis.factor, 4) for axis in axes])
        return points

    def lateness(self):
        """[us] of the latest pulse in the last second; None: unknown."""
        values = self.driver.engine.message
        if values is None or time.monotonic() - self.driver.engine.at > 3.0:
            return None
        try:
            late = float(values[LATENESS])
        except (KeyError, ValueError):
            return None
        return late if math.isfinite(late) else None
