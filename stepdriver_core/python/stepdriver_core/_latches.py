"""Positions of axes at edges of an input."""

from __future__ import annotations

from typing import Any, Dict, List, Optional

from . import _core
from ._moves import _await
from ._states import LatchedEdge, LatchResult


class Latch:
    """A latch that was accepted: until its first edge, or for every edge until end().

    All calls are safe from any thread. The object keeps its machine.
    """

    def __init__(self, handle: _core.LatchHandle, threaded: bool) -> None:
        self._handle = handle
        self._threaded = threaded

    def edges(self) -> List[LatchedEdge]:
        """The edges since the last call, in their order. Of more than 10,000 only the latest are there."""
        return [_latched_edge(fields) for fields in self._handle.take()]

    @property
    def result(self) -> Optional[LatchResult]:
        """How it ended, however long ago; None if it hasn't ended."""
        fields = self._handle.result()
        return None if fields is None else _latch_result(fields)

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return self._handle.result() is not None

    def wait(self, timeout: Optional[float] = None) -> LatchResult:
        """Returns when it has ended: after its first edge, by end(), or with the machine.

        timeout: [s] None: as long as it takes. It counts real time, or the virtual time of the machine.

        Raises Timeout if it hasn't ended by then; it continues.
        """
        return _latch_result(_await(self._handle.wait, self._threaded, timeout, "the latch"))

    def end(self) -> None:
        """Ends it. Does nothing if it has ended."""
        self._handle.end()

    def __repr__(self) -> str:
        result = self.result
        return f"<Latch: {result.message if result else 'waits for an edge'}>"


def _latched_edge(fields: Dict[str, Any]) -> LatchedEdge:
    return LatchedEdge(**fields)


def _latch_result(fields: Dict[str, Any]) -> LatchResult:
    if fields["edge"] is not None:
        fields["edge"] = _latched_edge(fields["edge"])
    return LatchResult(**fields)
