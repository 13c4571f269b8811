"""A whole machine."""

from __future__ import annotations

import os
import types
import typing
from typing import Any, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple, Type, Union

from . import _core
from ._axis import Axis, _homing_result
from ._errors import NoContact, NoSuchAxis, NotHomed
from ._latches import Latch
from ._moves import CoordinatedMove
from ._paths import Segment
from ._states import (
    AxisState,
    EngineFigures,
    HomingEnd,
    HomingResult,
    InputState,
    OutputState,
    ProbeEnd,
    ProbeResult,
    RigReport,
)

if typing.TYPE_CHECKING:
    from typing_extensions import Self

PathName = Union[str, "os.PathLike[str]"]


class Machine:
    """All axes of a machine, with its GPIO lines or the simulated rig::

        with Machine.from_file("axis.yaml") as machine:
            machine["x"].enable()
            machine["x"].move_to(0.05).wait()

    The end of the ``with`` block decelerates, disables the motors that are configured so, and releases the lines. So
    does shutdown(), and the end of the program.

    All calls are safe from any thread, and other threads of Python run while one waits. The pulses come from threads
    of the library, which never wait for Python. After os.fork() only the parent can use the machine.
    """

    def __init__(
        self,
        config: Mapping[str, Any],
        *,
        simulated: Optional[bool] = None,
        speed: Optional[float] = None,
        trace: Optional[PathName] = None,
        virtual_time: bool = False,
    ) -> None:
        """Opens a machine whose configuration is a dict, with the keys of a configuration file.

        The other arguments, and what it raises: as for from_file().
        """
        _check_speed(speed, virtual_time)
        self._open(
            _core.open_config(dict(config), simulated, 0.0 if virtual_time else speed, _text(trace), not virtual_time)
        )

    @classmethod
    def from_file(
        cls,
        path: PathName,
        *,
        simulated: Optional[bool] = None,
        speed: Optional[float] = None,
        trace: Optional[PathName] = None,
        virtual_time: bool = False,
    ) -> Self:
        """Opens the machine of a configuration file in YAML, which docs/parameters.md describes. Nothing moves.

        simulated: True: the simulated rig, whatever the file says; False: GPIO lines; None: as in the file.
        speed: seconds of the rig per second; 0: as fast as possible; None: as in the file, or 1.
        trace: the path of a VCD file for each edge of the rig; None: as in the file.
        virtual_time: the time of the rig passes only within wait(), home(), advance() and other calls that wait, in
            an instant, and the same calls give the same pulses to the nanosecond: for tests. Not with ``speed``.

        Raises ConfigError with every mistake, Error if the file can't be read, and GpioError if a line can't be
        requested; then no line is held.
        """
        _check_speed(speed, virtual_time)
        machine = cls.__new__(cls)
        machine._open(
            _core.open_file(os.fspath(path), simulated, 0.0 if virtual_time else speed, _text(trace), not virtual_time)
        )
        return machine

    def _open(self, session: _core.Session) -> None:
        self._session = session
        self._axes = {config["name"]: Axis(session, config) for config in session.axes()}
        self._description = session.description()

    def shutdown(self) -> None:
        """Refuses every command from now on, decelerates, disables the axes that are configured so, and releases the
        lines. Moves under way end as stopped. Does nothing if that was done.

        Raises Error if a line or the state file can't be written; all other lines are written.
        """
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        traceback: Optional[types.TracebackType],
    ) -> None:
        self.shutdown()

    # ---- axes ----

    def __getitem__(self, name: str) -> Axis:
        """The axis of that name. Raises NoSuchAxis, which is also a KeyError."""
        try:
            return self._axes[name]
        except KeyError:
            raise NoSuchAxis(f"there is no axis {name} (axes: {', '.join(self._axes)})") from None

    def __contains__(self, name: object) -> bool:
        return name in self._axes

    def __iter__(self) -> Iterator[str]:
        return iter(self._axes)

    def __len__(self) -> int:
        return len(self._axes)

    @property
    def axes(self) -> Tuple[Axis, ...]:
        """The axes in the order of the configuration."""
        return tuple(self._axes.values())

    @property
    def positions(self) -> Dict[str, float]:
        """[m or rad] where the axes are, by their names."""
        return {name: axis.position for name, axis in self._axes.items()}

    @property
    def states(self) -> Dict[str, AxisState]:
        """What each axis is and does now, by its name."""
        return {name: axis.state for name, axis in self._axes.items()}

    # ---- motions of several axes ----

    def move_line(
        self,
        positions: Mapping[str, float],
        *,
        relative: bool = False,
        velocity: Optional[float] = None,
        duration: Optional[float] = None,
    ) -> CoordinatedMove:
        """A straight line of several axes, which begin and end together. Axes that move come to rest first.

        positions: [m or rad] by the names of the axes: ``{"x": 0.1, "y": 0.05}``.
        relative: they count from where the axes are commanded to.
        velocity: the highest speed along the line, [m/s], or [rad/s] if only rotary axes move; None: as fast as the
            limits of all axes allow.
        duration: [s] that the line takes; not together with a velocity.

        Raises Refused as Axis.move_to().
        """
        handle = self._session.move_line(dict(positions), relative, velocity or 0.0, duration or 0.0)
        return self._coordinated(handle)

    def follow_path(
        self,
        axes: Sequence[str],
        segments: Iterable[Segment],
        *,
        relative: bool = False,
        velocity: Optional[float] = None,
        tolerance: float = 0.0,
        more_follows: bool = False,
        leads: Optional[Mapping[str, Tuple[float, float]]] = None,
    ) -> CoordinatedMove:
        """Moves several axes along lines, arcs and Bezier curves, from where they stand to rest at the end.

        axes: their names.
        segments: PathSegments, or sequences of numbers as lines to there: an array of numpy with a row for each
            point, for example. There may be 20,000.
        relative: all positions count from the commanded positions at the begin.
        velocity: the highest speed along the path [m/s], or [rad/s] while only rotary axes move; None: as fast as
            the limits of all axes allow.
        tolerance: [unit] how far corners may be rounded; 0: the axes stop at each corner.
        more_follows: segments will be appended by CoordinatedMove.append(): the axes wait at the end.
        leads: [s] how much earlier than at their places outputs of the segments are switched on and off, by their
            names: from 0 to 10.

        Raises Refused as Axis.move_to(), if one of the axes moves, or naming the segment that is wrong, from 0 on.
        """
        handle = self._session.follow_path(
            list(axes), segments, relative, velocity or 0.0, tolerance, more_follows, dict(leads or {})
        )
        return self._coordinated(handle)

    def follow_trajectory(
        self,
        axes: Sequence[str],
        times: Iterable[float],
        positions: Iterable[Sequence[float]],
        velocities: Optional[Iterable[Sequence[float]]] = None,
        accelerations: Optional[Iterable[Sequence[float]]] = None,
        *,
        allow_slower: bool = False,
        begin_in: float = 0.0,
    ) -> CoordinatedMove:
        """Moves several axes through the points of a trajectory; it can interrupt their motions.

        axes: their names.
        times: [s] of the points, after the begin.
        positions: [unit] a row for each time, with a number for each axis.
        velocities, accelerations: [unit/s] and [unit/s^2] the same; None: those of a spline through the positions.
        allow_slower: if a limit of an axis doesn't allow the times, all times are multiplied by the smallest factor
            that it allows. Otherwise such a trajectory is refused.
        begin_in: [s] from now.

        Raises Refused as Axis.move_to(), and if the limits of an axis don't allow it.
        """
        handle = self._session.follow_trajectory(
            list(axes), times, positions, velocities, accelerations, allow_slower, begin_in
        )
        return self._coordinated(handle)

    def home(self, axes: Sequence[str] = (), *, check: bool = True) -> List[HomingResult]:
        """Homes several axes in their configured order, and returns when all is over; see Axis.home().

        axes: their names; empty: all that have a homing.
        check: raise NotHomed if one fails or is cancelled; those that come later aren't homed.
        """
        results = [_homing_result(fields) for fields in self._session.home(list(axes))]
        failed = [result for result in results if result.end is not HomingEnd.HOMED]
        if check and failed:
            raise NotHomed(failed[0].message, tuple(results))
        return results

    def jog(
        self, velocities: Mapping[str, float], *, unless_stopped_since: Optional[Mapping[str, int]] = None
    ) -> Dict[str, str]:
        """Jogs several axes, see Axis.jog(): those at rest begin together.

        velocities: [unit/s] by the names of the axes.
        unless_stopped_since: ``state.stops`` by the names of the axes, as they were when the stream of jogs began.

        Returns why an axis does not jog, by its name: empty if all do.
        """
        return self._session.jog_all(dict(velocities), dict(unless_stopped_since or {}))

    def follow_positions(
        self,
        positions: Mapping[str, float],
        *,
        timeout: float = 0.2,
        unless_stopped_since: Optional[Mapping[str, int]] = None,
    ) -> Dict[str, str]:
        """The next positions of a stream, at 20 to 500 Hz. Each axis passes them about one period later, at the
        velocity of the stream; if no other one comes, it returns to the last one. A position beyond a soft limit is
        replaced by that.

        positions: [unit] by the names of the axes.
        timeout: [s] 0.005 to 60: without another position the axes then slow down to rest, wherever they are.
        unless_stopped_since: as for jog().

        Returns why an axis does not follow, by its name: empty if all do.
        """
        since = dict(unless_stopped_since or {})
        return self._session.follow_setpoints(False, timeout, dict(positions), since)

    def follow_velocities(
        self,
        velocities: Mapping[str, float],
        *,
        timeout: float = 0.2,
        unless_stopped_since: Optional[Mapping[str, int]] = None,
    ) -> Dict[str, str]:
        """The next velocities of a stream [unit/s]: see follow_positions()."""
        since = dict(unless_stopped_since or {})
        return self._session.follow_setpoints(True, timeout, dict(velocities), since)

    # ---- all axes ----

    def enable(self) -> None:
        """Energizes the motors of all axes: see Axis.enable()."""
        for axis in self.axes:
            axis.enable()

    def disable(self) -> None:
        """Takes the current of all motors away: see Axis.disable()."""
        for axis in self.axes:
            axis.disable()

    def stop(self) -> None:
        """Decelerates every axis to rest, and ends a hold. Returns when that has begun."""
        self._session.stop()

    def hold(self) -> None:
        """Feed hold: every axis decelerates to rest along its path, and keeps its goal; a jog ends. New motions are
        refused until resume() or stop()."""
        self._session.hold()

    def resume(self) -> None:
        """Ends the hold: held motions continue. Raises Refused if one of them can't; then all stay on hold."""
        self._session.resume()

    def set_speed_override(self, factor: float) -> None:
        """Scales the velocities of all motions, also those under way, within the limits of their axes.

        factor: 0.01 to 2.0. Raises Refused if it is outside of that.
        """
        self._session.set_speed_override(factor)

    def emergency_stop(self) -> None:
        """Completes the current pulse, sends no more, and returns then. Every axis is at fault until recover().

        It isn't a certified safety function.
        """
        self._session.emergency_stop()

    @property
    def emergency_stopped(self) -> bool:
        """True from an emergency stop until recover()."""
        return self._session.emergency_stopped()

    def recover(self) -> None:
        """Clears the emergency stop and all faults. Nothing moves.

        Raises Refused while the emergency-stop input is active, and Error if an axis can't recover.
        """
        self._session.recover()

    # ---- outputs and inputs ----

    @property
    def outputs(self) -> Dict[str, OutputState]:
        """The states of the outputs that have a name (``outputs`` in the configuration), by their names."""
        return {name: OutputState(**fields) for name, fields in self._session.outputs().items()}

    @property
    def inputs(self) -> Dict[str, InputState]:
        """The states of the inputs that have a name (``inputs`` in the configuration), by their names."""
        return {name: InputState(**fields) for name, fields in self._session.inputs().items()}

    def set_output(self, name: str, on: float) -> None:
        """Switches an output, as soon as its least times allow, and returns when its line was written.

        on: True or False; of a PWM output also a number between 0 and 1: how far its pulses are from the length of
        off to that of on.

        From an emergency stop, a fault of the machine or a shutdown on, each output is in its safe state.

        Raises Refused if there is no such output or while the outputs are in their safe states, and Error if its line
        can't be written.
        """
        self._session.set_output(name, on != 0, float(on) if on else 1.0)

    def set_position_compare(
        self,
        output: str,
        axis: str,
        *,
        cams: Iterable[Tuple[float, float]] = (),
        places: Iterable[float] = (),
        every: Optional[Tuple[float, float, float]] = None,
        at_end: bool = False,
        pulse: float = 0.0,
        direction: str = "both",
        lead_on: float = 0.0,
        lead_off: float = 0.0,
    ) -> None:
        """Lets the position of an axis switch an output with a name, at the nanosecond at which the joint arrives at a
        place, until clear_position_compare(). The axis never stops for it. An output has cams, or pulses at any of the
        others.

        cams: [unit] pairs of places: the output is on from the first one to the second.
        places: [unit] a pulse at each.
        every: distance, begin and end [unit]: a pulse at begin, and at each further distance as far as end.
        at_end: a pulse when a motion has come to its target.
        pulse: [s] how long a pulse is on, from 0.00001 to 10.
        direction: "both", or in which the axis must move: "up" or "down".
        lead_on, lead_off: [s] how much earlier than at its place it is switched, from 0 to 10.

        ``outputs[output].compared`` counts what was made, and ``missed`` what was passed and couldn't be.

        Raises Refused if there is no such output or axis, a place is outside of the soft limits, the output can't be
        switched as fast as the top speed of the axis would need it, or the axis moves.
        """
        directions = {"both": 0, "up": 1, "down": -1}
        if direction not in directions:
            raise ValueError(f"direction is {direction!r}, but must be 'both', 'up' or 'down'")
        self._session.set_position_compare(
            output,
            axis,
            directions[direction],
            [(float(begin), float(end)) for begin, end in cams],
            [float(place) for place in places],
            every,
            at_end,
            {"pulse": pulse, "lead_on": lead_on, "lead_off": lead_off},
        )

    def clear_position_compare(self, output: str) -> None:
        """No position switches the output any more: it goes off. Raises Refused if there is no such output."""
        self._session.clear_position_compare(output)

    # ---- edges of inputs ----

    def latch(
        self,
        input: str,
        *,
        edge: str = "active",
        every: bool = False,
        axes: Sequence[str] = (),
        window: Optional[Tuple[str, float, float]] = None,
    ) -> Latch:
        """Latches the positions of axes at edges of an input with a name, by the kernel's time stamps, while they move
        or rest. Nothing that happens to the axes ends it.

        edge: those that count: to "active", to "inactive", or "either".
        every: each edge counts until Latch.end(); False: the first one ends it.
        axes: their names; empty: all.
        window: edges count only while this axis is between these positions [unit]: ``("x", 0.01, 0.05)``.

        Raises Refused if there is no such input or axis, or if the window is empty.
        """
        edges = ("active", "inactive", "either")
        if edge not in edges:
            raise ValueError(f"edge is {edge!r}, but must be 'active', 'inactive' or 'either'")
        return Latch(self._session.latch(input, edge, every, list(axes), window), self._session.is_threaded)

    def probe(
        self,
        input: str,
        positions: Mapping[str, float],
        *,
        relative: bool = False,
        away: bool = False,
        must: bool = True,
        velocity: Optional[float] = None,
        second_velocity: Optional[float] = None,
        back_off: float = 0.0,
        go_back: bool = False,
        check: bool = True,
    ) -> ProbeResult:
        """Moves axes along a straight line until an input with a name tells of a contact. They come to rest then, and
        the result has the place of the contact, by the edge's time stamp. Returns at the end.

        positions: [unit] where the line ends without a contact, by the names of the axes.
        relative: they count from where the axes are commanded to.
        away: the contact is where the input becomes inactive, not active.
        must: without a contact it has failed.
        velocity: as of move_line().
        second_velocity: of a second touch, from ``back_off`` [unit] before the first contact; None: none.
        go_back: at the end the axes stand at the contact, not where they came to rest.
        check: raise NoContact if it has failed; False: return the result in any case.

        Raises Refused as latch() and move_line(), and if the input tells of a contact at the start.
        """
        manner = {"relative": relative, "away": away, "must": must, "go_back": go_back}
        values = {"velocity": velocity or 0.0, "second_velocity": second_velocity or 0.0, "back_off": back_off}
        fields = self._session.probe(input, dict(positions), manner, values)
        fields["end"] = ProbeEnd(fields["end"])
        fields["contact"] = dict(zip(positions, fields["contact"])) if fields["contact"] else None
        fields["positions"] = dict(zip(positions, fields["positions"]))
        result = ProbeResult(**fields)
        if check and not result.succeeded:
            raise NoContact(result.message, result)
        return result

    # ---- time and figures ----

    @property
    def is_open(self) -> bool:
        """False after shutdown()."""
        return self._session.is_open

    @property
    def time(self) -> float:
        """[s] on the clock that times the pulses. Its zero is arbitrary."""
        return self._session.time()

    def advance(self, seconds: float) -> None:
        """Lets so much virtual time pass. Raises Refused if the machine has real time."""
        self._session.advance(seconds)

    @property
    def figures(self) -> EngineFigures:
        """What the pulse engine has done so far."""
        return EngineFigures(**self._session.figures())

    @property
    def rig(self) -> Rig:
        """The simulated rig, for tests. Its calls raise Refused if the machine drives GPIO lines."""
        return Rig(self._session)

    def _coordinated(self, handle: _core.CoordinatedMoveHandle) -> CoordinatedMove:
        return CoordinatedMove(handle, self._session.is_threaded)

    def __repr__(self) -> str:
        shut = "" if self.is_open else ", shut down"
        return f"<Machine of {', '.join(self._axes)} on {self._description}{shut}>"


class Rig:
    """The simulated rig of a machine: motors, carriages and switches."""

    def __init__(self, session: _core.Session) -> None:
        self._session = session

    def report(self, axis: str) -> RigReport:
        """What an axis of the rig has seen so far."""
        return RigReport(**self._session.rig_report(axis))

    def press_endstop(self, axis: str, end: str, pressed: bool = True) -> None:
        """Presses the switch at an end of an axis as if by hand, or releases it.

        end: ``min`` or ``max``. Raises Refused if the axis has no switch there.
        """
        if end not in ("min", "max"):
            raise ValueError(f"the end is {end!r}, but must be 'min' or 'max'")
        self._session.press_endstop(axis, end == "max", pressed)

    def press_input(self, name: str, pressed: bool = True) -> None:
        """Makes an input with a name active as if by hand, or inactive. Raises Error if there is no such input."""
        self._session.press_input(name, pressed)

    def press_emergency_stop(self, pressed: bool = True) -> None:
        """Presses the button of the emergency-stop input, or releases it. Raises Refused if none is configured."""
        self._session.press_emergency_stop(pressed)


def _check_speed(speed: Optional[float], virtual_time: bool) -> None:
    if virtual_time and speed is not None:
        raise ValueError("virtual_time has no speed: leave one of the two out")


def _text(path: Optional[PathName]) -> str:
    return "" if path is None else os.fspath(path)
