"""Moves the axes of a machine by stepper motors, from GPIO lines or on a simulated rig. It needs no ROS::

    from stepdriver_core import Machine

    with Machine.from_file("axis.yaml", simulated=True) as machine:
        x = machine["x"]
        x.enable()
        x.move_to(0.05).wait()   # 50 mm
        print(x.position, x.state.enabled)

Positions are in m on a linear axis and in rad on a rotary one, times in s. Only configurations have mm and degrees.
A command that can't be accepted raises Refused, and changes nothing; all errors are subclasses of Error.
"""

from ._axis import Axis
from ._core import __version__
from ._errors import (
    ConfigError,
    ConfigIssue,
    Error,
    GpioError,
    NoContact,
    NoSuchAxis,
    NotHomed,
    NotReached,
    Refused,
    StateFileError,
    Timeout,
)
from ._latches import Latch
from ._machine import Machine, Rig
from ._moves import CoordinatedMove, Move
from ._paths import PathSegment, Segment, arc_around, arc_through, bezier, line
from ._plans import Motion, Part, Piece, Plan
from ._states import (
    AxisState,
    ChipState,
    CoordinatedResult,
    Endstops,
    EngineFigures,
    HomingEnd,
    HomingResult,
    InputState,
    LatchedEdge,
    LatchResult,
    Limits,
    MoveEnd,
    MoveResult,
    OutputState,
    PathAhead,
    ProbeEnd,
    ProbeResult,
    RigReport,
)

__all__ = [
    "Axis",
    "AxisState",
    "ChipState",
    "ConfigError",
    "ConfigIssue",
    "CoordinatedMove",
    "CoordinatedResult",
    "Endstops",
    "EngineFigures",
    "Error",
    "GpioError",
    "HomingEnd",
    "HomingResult",
    "InputState",
    "Latch",
    "LatchResult",
    "LatchedEdge",
    "Limits",
    "Machine",
    "Motion",
    "Move",
    "MoveEnd",
    "MoveResult",
    "NoContact",
    "NoSuchAxis",
    "NotHomed",
    "NotReached",
    "OutputState",
    "Part",
    "PathAhead",
    "PathSegment",
    "Piece",
    "Plan",
    "ProbeEnd",
    "ProbeResult",
    "Refused",
    "Rig",
    "RigReport",
    "Segment",
    "StateFileError",
    "Timeout",
    "__version__",
    "arc_around",
    "arc_through",
    "bezier",
    "line",
]

# Errors and help() show where users find these names.
for _name in __all__:
    if isinstance(globals()[_name], type) or callable(globals()[_name]):
        try:
            globals()[_name].__module__ = __name__
        except AttributeError:
            pass
del _name
