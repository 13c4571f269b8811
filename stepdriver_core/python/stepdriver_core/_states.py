"""What a machine says about itself. A unit is m on a linear axis, rad on a rotary one."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any, Dict, Optional, Tuple


class MoveEnd(str, enum.Enum):
    """How a move ended. A member compares equal to its text: ``result.end == "reached"``."""

    REACHED = "reached"
    STOPPED = "stopped"  # by a stop, a disable or a shutdown
    REPLACED = "replaced"  # by a later move or a jog
    ENDSTOP_MIN = "endstop_min"  # the endstop was met
    ENDSTOP_MAX = "endstop_max"
    EMERGENCY_STOP = "emergency_stop"
    FAULT = "fault"  # pulses too late, or a line that failed
    COMPANION = "companion"  # an axis that it moved together with was stopped by one of these


class HomingEnd(str, enum.Enum):
    """How a homing ended."""

    HOMED = "homed"
    CANCELLED = "cancelled"  # by Ctrl-C
    FAILED = "failed"  # also by a stop


@dataclass(frozen=True)
class MoveResult:
    """How and where a move ended."""

    end: MoveEnd
    message: str
    """A sentence that says how and at which position."""
    position: float
    """[unit] where the axis stands."""
    duration: float
    """[s] that the motion took."""


@dataclass(frozen=True)
class CoordinatedResult:
    """How and where a motion of several axes ended."""

    end: MoveEnd
    """How it ended: REACHED, or what ended it first."""
    message: str
    """A sentence that says how, and names the axis that ended it."""
    positions: Dict[str, float]
    """[unit] where the axes stand, by their names."""
    duration: float
    """[s] that it took."""


@dataclass(frozen=True)
class HomingResult:
    """How and where the homing of an axis ended."""

    axis: str
    """The name of the axis."""
    end: HomingEnd
    message: str
    """A sentence that says how it ended, and at which position."""
    position: float
    """[unit] where the axis stands."""
    skew: float
    """[unit] how far its motors were apart before this homing made them square; 0 if it has only one."""


@dataclass(frozen=True)
class ChipState:
    """What a driver chip on a UART (``tmc`` in the configuration) has told of itself."""

    motor: str
    """The name of its motor, on an axis with several; empty: it is the only one."""
    is_set_up: bool
    """Its registers are written and verified."""
    run_current: float
    """[A rms] as it is set, in motion."""
    hold_current: float
    """[A rms] the same at rest."""
    present_current: float
    """[A rms] at this moment, on the way from one to the other."""
    stealth_chop: bool
    """It chops silently at this moment."""
    at_least_celsius: int
    """[degrees C] the highest threshold that its temperature is above; 0: none."""
    temperature_warning: bool
    """It will soon switch itself off."""
    stall_guard: Optional[int]
    """SG_RESULT in the last motion: the lower, the higher the load; None: the chip hasn't measured it."""


@dataclass(frozen=True)
class AxisState:
    """What an axis is and does at one instant."""

    enabled: bool
    """By its own commands, and with power."""
    asleep: bool
    """Its chip sleeps."""
    powered: bool
    """The power of all motors is there, or nothing switches it."""
    brake_engaged: bool
    """The line of its brake has the level that engages it."""
    idle: bool
    """Disabled, asleep or at a lower current by its idle timeout; the next motion ends that."""
    moving: bool
    """It moves."""
    held: bool
    """The machine is on hold: this axis too, moving or not."""
    homed: bool
    """A homing has found its zero."""
    homing: str
    """The phase of a homing under way, such as ``seeking``; ``none`` if there is none."""
    position_valid: bool
    """The position can be trusted. If not, ``fault`` or ``position_note`` may say why; motors without current, for
    example, can be turned by hand."""
    microsteps: int
    """Microsteps per full step."""
    speed_override: float
    """The factor of all velocities."""
    position: float
    """[unit] from the count of the pulses that went out."""
    planned: float
    """[unit] the planned position of the motion under way; the position at rest."""
    velocity: float
    """[unit/s] of the plan."""
    slack: float
    """[unit] the part of the backlash that is taken up towards max."""
    skew: float
    """[unit] how far its motors have got apart since they were square."""
    target: float
    """[unit] where the motion under way ends; the position at rest, and in a jog without an end."""
    time_left: float
    """[s] until the motion under way ends, as planned; 0 at rest and in a jog without an end."""
    fault: str
    """The fault in words; empty: no fault."""
    remedy: str
    """What ends the fault, in words."""
    stops: int
    """How many times something has stopped the axis, or ended that: see ``unless_stopped_since`` of jog()."""
    stopped_by: str
    """At which endstop its last motion ended, and where; empty: at none, it was a homing, or the next one has begun."""
    position_note: str
    """Why the position that was kept over a restart can't be trusted; empty: it can, or there is none."""
    chips: Tuple[ChipState, ...]
    """Its driver chips on a UART, one for each motor that has such a chip."""


def _axis_state(fields: Dict[str, Any]) -> AxisState:
    values: Dict[str, Any] = {**fields, "chips": tuple(ChipState(**chip) for chip in fields["chips"])}
    return AxisState(**values)


@dataclass(frozen=True)
class Endstops:
    """Levels of the switches of an axis as their lines read now."""

    min: Optional[bool]
    """True if the switch is active; None: there is no switch at that end."""
    max: Optional[bool]
    """The same at the other end."""


@dataclass(frozen=True)
class Limits:
    """The limits of the next motions of an axis."""

    max_speed: float
    """[unit/s]"""
    acceleration: float
    """[unit/s^2]"""
    deceleration: float
    """[unit/s^2] not of stops, which use the configured one."""
    jerk: float
    """[unit/s^3] 0: no limit, the acceleration may jump."""


@dataclass(frozen=True)
class PathAhead:
    """What lies ahead of axes on a path to which segments can be appended."""

    segments: int
    """Segments that they have not passed."""
    room: int
    """So many more can be appended."""
    time: float
    """[s] that those ahead take at the speed override of 1."""
    passed: float
    """[s] that the path took until now, at that override."""
    more_follows: bool
    """False: the end of these is the end of the path."""
    targets: Tuple[float, ...]
    """[unit] the commanded positions at their end, in the order of the path's axes."""


@dataclass(frozen=True)
class OutputState:
    """The state of an output with a name."""

    on: bool
    """As its line was written last."""
    value: float
    """The same: 0 off, 1 on, and between them a PWM output that is on in part."""
    changed: Optional[float]
    """[s] on the clock of ``Machine.time``, when that write had ended; None: not since the start."""
    note: str
    """Why it was switched off by itself; empty until that happens."""
    error: str
    """Why its line could not be written, so that ``on`` isn't certain; empty: it could."""
    axis: str
    """Whose position switches it, see ``Machine.set_position_compare()``; empty: none does."""
    compared: int
    """What positions have made it do since the start."""
    missed: int
    """What they could not: a pulse was due while the one before was on, or the output was in its safe state."""


@dataclass(frozen=True)
class InputState:
    """The state of an input with a name."""

    active: bool
    """Its level is the active one."""
    changed: Optional[float]
    """[s] on the clock of ``Machine.time``, when the level changed; None: not since the start."""
    error: str
    """Why it can't be read, so that ``active`` is the last reading; empty: it can."""


@dataclass(frozen=True)
class LatchedEdge:
    """An edge of an input, and where the axes were then."""

    number: int
    """Of the edges of this latch, from 1 on."""
    active: bool
    """The input became active; False: inactive."""
    time: float
    """[s] on the clock of ``Machine.time``, by the kernel's time stamp of the edge."""
    was_read: bool
    """The kernel has lost the edge: the time is that of the reading that shows the level."""
    positions: Dict[str, float]
    """[m or rad] of the axes at that time, by their names."""
    valid: Dict[str, bool]
    """Whether each of them could be trusted."""


@dataclass(frozen=True)
class LatchResult:
    """How a latch ended."""

    latched: bool
    """There was an edge."""
    message: str
    """A sentence that says how it ended."""
    edge: Optional[LatchedEdge]
    """The last edge."""
    edges: int
    """How many there were."""


class ProbeEnd(str, enum.Enum):
    """How a probing ended. A member compares equal to its text."""

    CONTACT = "contact"
    NO_CONTACT = "no_contact"
    CANCELLED = "cancelled"
    FAILED = "failed"  # something else ended it: a stop, a fault, an endstop, another command


@dataclass(frozen=True)
class ProbeResult:
    """What a probing has found."""

    end: ProbeEnd
    succeeded: bool
    """There was a contact, or it need not be."""
    message: str
    """A sentence that says how it ended."""
    contact: Optional[Dict[str, float]]
    """[m or rad] where the axes were at the last contact, by their names; None: there was none."""
    was_read: bool
    """The kernel has lost its edge: they were there when the input was read."""
    positions: Dict[str, float]
    """[m or rad] where they stand."""


@dataclass(frozen=True)
class EngineFigures:
    """What the pulse engine has done since the start."""

    pulses: int
    """Pulses of all axes."""
    slips: int
    """Times that the timeline was slid because a pulse was late."""
    slipped: float
    """[s] by how much altogether."""
    worst_lateness: float
    """[s] of one pulse."""
    realtime: str
    """How the pulse thread runs, in words."""


@dataclass(frozen=True)
class RigReport:
    """What an axis of the simulated rig has seen so far. Its units are those of the configuration."""

    pulses_forward: int
    """Pulses with DIR forward."""
    pulses_backward: int
    """Pulses with DIR backward."""
    carriage: float
    """[mm or degrees] where the carriage is."""
    microsteps: int
    """The mode of the chip at its last pulse."""
    lost_steps: int
    """Full steps that the motor lost."""
    energized: bool
    """Current flows."""
    min_pressed: bool
    """The carriage, or a hand, presses the switch at the min end."""
    max_pressed: bool
    """The same at the other end."""
    violations: Dict[str, int]
    """What the chip must never see, with how often it has seen it: empty if all was well."""
