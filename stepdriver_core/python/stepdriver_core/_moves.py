"""Motions that a machine has accepted."""

from __future__ import annotations

import math
import time
from typing import Any, Callable, Dict, Generic, Iterable, Optional, TypeVar

from . import _core
from ._errors import NotReached, Timeout
from ._paths import Segment
from ._states import CoordinatedResult, MoveEnd, MoveResult, PathAhead

# [s] Between two looks whether a signal such as Ctrl-C has come: a person doesn't notice the delay.
_PATIENCE = 0.05


def _await(
    wait: Callable[[Optional[float]], Optional[Dict[str, Any]]],
    threaded: bool,
    timeout: Optional[float],
    what: str = "the move",
) -> Dict[str, Any]:
    if timeout is not None and math.isnan(timeout):
        raise ValueError("the timeout isn't a number")
    bounded = timeout is not None and timeout < math.inf
    if not threaded:  # virtual time passes in an instant
        result = wait(timeout if bounded else None)
    else:
        end = time.monotonic() + timeout if timeout is not None else math.inf
        while True:
            result = wait(max(0.0, min(_PATIENCE, end - time.monotonic())))
            if result is not None or time.monotonic() >= end:
                break
    if result is None:
        raise Timeout(f"{what} hasn't ended in {timeout:g} s; it continues")
    return result


_Handle = TypeVar("_Handle", _core.MoveHandle, _core.CoordinatedMoveHandle)
_Result = TypeVar("_Result", MoveResult, CoordinatedResult)


class _Accepted(Generic[_Handle, _Result]):
    """What a motion of one axis and one of several have in common."""

    def __init__(self, handle: _Handle, threaded: bool) -> None:
        self._handle: _Handle = handle
        self._threaded = threaded

    def _result(self, fields: Dict[str, Any]) -> _Result:
        raise NotImplementedError

    @property
    def duration(self) -> float:
        """[s] that it takes, as planned."""
        return self._handle.duration

    @property
    def result(self) -> Optional[_Result]:
        """How it ended, however long ago; None if it hasn't ended."""
        fields = self._handle.result()
        return None if fields is None else self._result(fields)

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return self._handle.result() is not None

    def wait(self, timeout: Optional[float] = None, *, check: bool = True) -> _Result:
        """Returns when it has ended. Other threads run meanwhile, and Ctrl-C ends the waiting, not the motion.

        timeout: [s] None: as long as it takes. It counts real time, or the virtual time of the machine.
        check: raise NotReached if it ended before its target; False: return its result in any case.

        Raises Timeout if it hasn't ended by then; it continues.
        """
        result = self._result(_await(self._handle.wait, self._threaded, timeout))
        if check and result.end is not MoveEnd.REACHED:
            raise NotReached(result.message, result)
        return result

    def cancel(self) -> None:
        """Decelerates the axes to rest, along the path of several, if they still make this motion; one that has
        replaced it continues."""
        self._handle.stop()


class Move(_Accepted[_core.MoveHandle, MoveResult]):
    """A motion of one axis that was accepted, and is under way or has ended.

    All calls are safe from any thread. The object keeps its machine.
    """

    def __init__(self, handle: _core.MoveHandle, axis: str, threaded: bool) -> None:
        super().__init__(handle, threaded)
        self._axis = axis

    @property
    def axis(self) -> str:
        """The name of the axis."""
        return self._axis

    @property
    def target(self) -> float:
        """[unit] the commanded position."""
        return self._handle.target

    @property
    def rest(self) -> float:
        """[unit] the microstep nearest to the target, where the axis comes to rest."""
        return self._handle.rest

    @property
    def overshoot(self) -> float:
        """[unit] how far the axis goes beyond the target, if it can't stop before it."""
        return self._handle.overshoot

    def _result(self, fields: Dict[str, Any]) -> MoveResult:
        fields["end"] = MoveEnd(fields["end"])
        return MoveResult(**fields)

    def __repr__(self) -> str:
        result = self.result
        return f"<Move of {self._axis} to {self.target:g}: {result.message if result else 'under way'}>"


class CoordinatedMove(_Accepted[_core.CoordinatedMoveHandle, CoordinatedResult]):
    """A motion of several axes that was accepted: a line, a path or a trajectory.

    All calls are safe from any thread. The object keeps its machine.
    """

    @property
    def targets(self) -> Dict[str, float]:
        """[unit] the commanded positions at its end, by the names of the axes."""
        return self._handle.targets

    def append(self, segments: Iterable[Segment], *, more_follows: bool = False) -> PathAhead:
        """Appends segments to a path that began with ``more_follows``, while the axes follow it.

        If the segments come too late, the axes wait at the former end of the path and continue from rest. The path
        ends after an append without ``more_follows``, which may have no segments.

        Raises Refused if the axes no longer follow this path, or as Machine.follow_path() for a segment. Then the
        path stays as it is.
        """
        return _path_ahead(self._handle.append(segments, more_follows))

    @property
    def ahead(self) -> Optional[PathAhead]:
        """What lies ahead on such a path; None if no axis follows it any longer, or nothing can be appended."""
        fields = self._handle.ahead()
        return None if fields is None else _path_ahead(fields)

    def _result(self, fields: Dict[str, Any]) -> CoordinatedResult:
        fields["end"] = MoveEnd(fields["end"])
        fields["positions"] = dict(zip(self._handle.targets, fields["positions"]))
        return CoordinatedResult(**fields)

    def __repr__(self) -> str:
        result = self.result
        return f"<CoordinatedMove of {', '.join(self.targets)}: {result.message if result else 'under way'}>"


def _path_ahead(fields: Dict[str, Any]) -> PathAhead:
    fields["targets"] = tuple(fields["targets"])
    return PathAhead(**fields)
