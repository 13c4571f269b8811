"""An axis of a machine."""

from __future__ import annotations

from typing import Any, Dict, Optional

from . import _core
from ._errors import NotHomed
from ._moves import Move
from ._plans import Part, Piece, Plan
from ._states import AxisState, Endstops, HomingEnd, HomingResult, Limits, _axis_state


class Axis:
    """One axis of a Machine: ``machine["x"]``. A unit is m on a linear axis, rad on a rotary one.

    All calls are safe from any thread. A command is either accepted as a whole, or raises Refused and changes
    nothing. The object keeps its machine.
    """

    def __init__(self, session: _core.Session, config: Dict[str, Any]) -> None:
        self._session = session
        self._config = config
        self._name: str = config["name"]

    @property
    def name(self) -> str:
        """Its name in the configuration."""
        return self._name

    @property
    def unit(self) -> str:
        """``m`` on a linear axis, ``rad`` on a rotary one."""
        return str(self._config["unit"])

    @property
    def driver(self) -> str:
        """The driver chip, such as ``A4988``."""
        return str(self._config["driver"])

    @property
    def min_position(self) -> Optional[float]:
        """[unit] the soft limit; None: there is none."""
        limit: Optional[float] = self._config["min_position"]
        return limit

    @property
    def max_position(self) -> Optional[float]:
        """[unit] the soft limit at the other end."""
        limit: Optional[float] = self._config["max_position"]
        return limit

    @property
    def continuous(self) -> bool:
        """Whether it turns without end: positions that differ by whole turns are the same place."""
        return bool(self._config["continuous"])

    # ---- motions ----

    def move_to(self, position: float, *, velocity: Optional[float] = None, shortest: bool = False) -> Move:
        """Moves to a position and rests there. Returns at once: ``wait()`` of the move waits for its end.

        It can interrupt another motion without a jump in speed, which ends that one.

        position: [unit] the target.
        velocity: [unit/s] the highest speed on the way; None: the axis's maximum.
        shortest: whole turns don't count, so the axis takes the shorter way. Only on a continuous axis.

        Raises Refused if the target is beyond a soft limit, the velocity is beyond the maximum, the endstop on the
        way is active, the axis is disabled, asleep, at fault or must be homed first, or the machine is on hold.
        """
        return self._move(self._session.move_to(self._name, position, False, velocity or 0.0, shortest))

    def move_by(self, distance: float, *, velocity: Optional[float] = None) -> Move:
        """Moves by a distance from the commanded position: from the target of the last move, even during that.

        distance: [unit] towards max if it is above 0.
        velocity: as for move_to().

        Raises Refused as move_to().
        """
        return self._move(self._session.move_to(self._name, distance, True, velocity or 0.0, False))

    def move_rounds(self, rounds: float, *, velocity: Optional[float] = None) -> Move:
        """Turns the motor by a number of revolutions, which need not be whole.

        velocity: [unit/s] as for move_to().

        Raises Refused as move_to(), and if the steps of a revolution aren't configured.
        """
        return self._move(self._session.move_rounds(self._name, rounds, velocity or 0.0))

    def plan(
        self, position: float, *, relative: bool = False, velocity: Optional[float] = None, shortest: bool = False
    ) -> Plan:
        """What move_to() would do now, or move_by() if ``relative``; nothing moves. ``plan(0.1).plot()`` draws it.

        Raises Refused as move_to().
        """
        fields = self._session.plan(self._name, position, relative, velocity or 0.0, shortest)
        fields["pieces"] = tuple(Piece(*piece) for piece in fields["pieces"])
        fields["parts"] = tuple(Part(*part) for part in fields["parts"])
        return Plan(axis=self._name, unit=self.unit, **fields)

    def jog(self, velocity: float, *, unless_stopped_since: Optional[int] = None) -> None:
        """Moves at a velocity until another command comes, or up to the soft limit. 0 ends a jog.

        velocity: [unit/s] negative: towards min.
        unless_stopped_since: ``state.stops`` as it was when a stream of jogs began: the jog is refused if something
            has stopped the axis since.

        Raises Refused as move_to(), and if the axis rests at the soft limit ahead.
        """
        self._session.jog(self._name, velocity, unless_stopped_since)

    def stop(self) -> None:
        """Decelerates to rest, with all axes that move together with this one. Returns when that has begun."""
        self._session.stop_axis(self._name)

    def home(self, *, check: bool = True) -> HomingResult:
        """Finds the axis's zero by its switch, and returns when that is over. Soft limits don't apply meanwhile.

        A stop or a disable ends it, from any thread; Ctrl-C decelerates, and then raises KeyboardInterrupt.

        check: raise NotHomed if it fails or is cancelled; False: return the result in any case.

        Raises Refused as move_to(), if homing isn't configured, and while the axis moves.
        """
        [result] = (_homing_result(fields) for fields in self._session.home([self._name]))
        if check and result.end is not HomingEnd.HOMED:
            raise NotHomed(result.message, (result,))
        return result

    # ---- the driver ----

    def enable(self) -> None:
        """Energizes the motor. Raises Refused if ENABLE isn't wired, or if the axis is at fault."""
        self._session.enable(self._name, True)

    def disable(self) -> None:
        """Takes the motor's current away; a motion under way is stopped first. The position is no longer valid then,
        unless holds_position_unpowered is configured."""
        self._session.enable(self._name, False)

    def sleep(self) -> None:
        """Puts the driver chip to sleep. Raises Refused while the axis moves, and if SLEEP isn't wired."""
        self._session.sleep(self._name, True)

    def wake(self) -> None:
        """Wakes the chip. Raises Refused as sleep()."""
        self._session.sleep(self._name, False)

    def reset(self) -> None:
        """Pulses RESET of the chip. Raises Refused while the axis moves, and if RESET isn't wired."""
        self._session.reset(self._name)

    def set_microsteps(self, microsteps: int) -> None:
        """Changes the microstep mode and keeps the position.

        Raises Refused while the axis moves, if the chip doesn't have the mode or its pins aren't wired, and if the
        new mode has no microstep at this position, unless align_on_microstep_change is configured.
        """
        self._session.set_microsteps(self._name, microsteps)

    def set_position(self, position: float) -> None:
        """Declares where the axis stands [unit]; the position is valid from then on. Nothing moves.

        Raises Refused while the axis moves, and beyond a soft limit.
        """
        self._session.set_position(self._name, position)

    def set_limits(
        self,
        *,
        max_speed: Optional[float] = None,
        acceleration: Optional[float] = None,
        deceleration: Optional[float] = None,
        jerk: Optional[float] = None,
    ) -> None:
        """Lowers limits of motions: [unit/s], [unit/s^2], [unit/s^2] and [unit/s^3]. Each that isn't given is as
        configured from now on. A move under way is planned again.

        Raises Refused if one is above the configured limit; a jerk limit may be added if none is configured.
        """
        wanted = (max_speed, acceleration, deceleration, jerk)
        self._session.set_limits(self._name, *(limit or 0.0 for limit in wanted))

    def set_current(self, run: Optional[float] = None, hold: Optional[float] = None) -> None:
        """Changes the currents of its driver chips on a UART (``tmc`` in the configuration), at rest or in motion, and
        returns when the chips have them. ``state.chips`` has what was set: the step of the chip below what is wanted.

        run: [A rms] in motion, at most the configured one; None: as configured.
        hold: [A rms] at rest, at most ``run``; None: as configured, or ``run`` if that is lower.

        Raises Refused if a current is out of range, or if no motor has such a chip.
        """
        self._session.set_current(self._name, run or 0.0, hold or 0.0)

    def set_stall_threshold(self, threshold: int) -> None:
        """Changes the threshold of stalls in any motion (StallGuard) of its driver chips on SPI, and of others with
        ``tmc/stall_fault_threshold``, and returns when the chips have it. A homing to a stall keeps its own.

        Raises Refused if it is out of range, or if no motor has such a chip.
        """
        self._session.set_stall_threshold(self._name, threshold)

    @property
    def limits(self) -> Limits:
        """The limits of its next motions."""
        return Limits(**self._session.limits(self._name))

    # ---- state ----

    @property
    def state(self) -> AxisState:
        """What the axis is and does now: consistent, of one instant."""
        return _axis_state(self._session.state(self._name))

    @property
    def position(self) -> float:
        """[unit] its place: the count of the pulses that went out."""
        return self.state.position

    @property
    def endstops(self) -> Endstops:
        """The levels of its switches. Raises GpioError if a line can't be read."""
        return Endstops(**self._session.endstops(self._name))

    def _move(self, handle: _core.MoveHandle) -> Move:
        return Move(handle, self._name, self._session.is_threaded)

    def __repr__(self) -> str:
        place = f"at {self.position:g} {self.unit}" if self._session.is_open else "of a machine that was shut down"
        return f"<Axis {self._name} {place}>"


def _homing_result(fields: Dict[str, Any]) -> HomingResult:
    fields["end"] = HomingEnd(fields["end"])
    return HomingResult(**fields)
