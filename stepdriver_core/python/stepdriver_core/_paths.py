"""Segments of paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping, Optional, Sequence, Tuple, Union

Outputs = Union[Mapping[str, float], Sequence[Tuple[str, float, float]]]
"""See ``outputs`` of line()."""


@dataclass(frozen=True)
class PathSegment:
    """A segment of a path, from the end of the one before it: make it by line(), arc_around(), arc_through() or
    bezier()."""

    shape: str
    end: Sequence[float]
    plane: Optional[Tuple[str, str]] = None
    point: Sequence[float] = (0.0, 0.0)
    clockwise: bool = False
    control1: Sequence[float] = ()
    control2: Sequence[float] = ()
    velocity: float = 0.0
    tolerance: Optional[float] = None
    outputs: Outputs = ()


Segment = Union[PathSegment, Sequence[float]]
"""A sequence of numbers, one for each axis of the path, is a line to there."""


def line(
    end: Sequence[float],
    *,
    velocity: Optional[float] = None,
    tolerance: Optional[float] = None,
    outputs: Optional[Outputs] = None,
) -> PathSegment:
    """A straight line to ``end``.

    end: [unit] a number for each axis of the path, m or rad.
    velocity: the highest speed along this segment, [m/s] or [rad/s]; None: that of the path.
    tolerance: [unit] how far the corner at its end may be rounded; None: that of the path.
    outputs: outputs with a name that are switched where the segment begins, at that time and without a stop: True is
        on, or a number between 0 and 1 for a PWM output, see ``Machine.set_output()``. Or a list of tuples: the name,
        that value, and how far along the segment that is, [m] or [rad]. A line to where the path already is switches
        them there, for example at its end.
    """
    return PathSegment("line", end, velocity=velocity or 0.0, tolerance=tolerance, outputs=outputs or ())


def arc_around(
    end: Sequence[float],
    centre: Sequence[float],
    *,
    clockwise: bool = False,
    plane: Optional[Tuple[str, str]] = None,
    velocity: Optional[float] = None,
    tolerance: Optional[float] = None,
    outputs: Optional[Outputs] = None,
) -> PathSegment:
    """A circular arc around ``centre``: a full turn if both of its ends are the same. Other axes move in proportion
    to its angle.

    end, velocity, tolerance, outputs: as for line().
    centre: [unit] of the two axes of the plane. It must be as far from the begin as from the end, up to rounding.
    clockwise: from the second axis of the plane to the first, instead of the other way.
    plane: the names of its two axes; None: the first two of the path.
    """
    return PathSegment(
        "arc_around",
        end,
        plane,
        centre,
        clockwise,
        velocity=velocity or 0.0,
        tolerance=tolerance,
        outputs=outputs or (),
    )


def arc_through(
    end: Sequence[float],
    point: Sequence[float],
    *,
    plane: Optional[Tuple[str, str]] = None,
    velocity: Optional[float] = None,
    tolerance: Optional[float] = None,
    outputs: Optional[Outputs] = None,
) -> PathSegment:
    """A circular arc through ``point``, which lies between its begin and its end.

    point: [unit] of the two axes of the plane.
    The others: as for arc_around().
    """
    return PathSegment(
        "arc_through", end, plane, point, velocity=velocity or 0.0, tolerance=tolerance, outputs=outputs or ()
    )


def bezier(
    control1: Sequence[float],
    control2: Sequence[float],
    end: Sequence[float],
    *,
    velocity: Optional[float] = None,
    tolerance: Optional[float] = None,
    outputs: Optional[Outputs] = None,
) -> PathSegment:
    """A cubic Bezier curve.

    control1, control2: [unit] its control points next to its begin and next to its end, like ``end``.
    end, velocity, tolerance, outputs: as for line().
    """
    return PathSegment(
        "bezier",
        end,
        control1=control1,
        control2=control2,
        velocity=velocity or 0.0,
        tolerance=tolerance,
        outputs=outputs or (),
    )
