"""What a move would be."""

from __future__ import annotations

import typing
from dataclasses import dataclass
from typing import Any, List, NamedTuple, Tuple

if typing.TYPE_CHECKING:
    from matplotlib.figure import Figure


class Piece(NamedTuple):
    """A cubic piece of position over time: position + velocity t + acceleration t^2/2 + jerk t^3/6."""

    duration: float
    """[s]"""
    position: float
    """[unit] at its begin, as the three below."""
    velocity: float
    """[unit/s]"""
    acceleration: float
    """[unit/s^2]"""
    jerk: float
    """[unit/s^3] all through it."""

    def at(self, time: float) -> Motion:
        """Its motion at a time [s] after its begin."""
        t = time
        return Motion(
            self.position + t * (self.velocity + t * (self.acceleration / 2 + t * self.jerk / 6)),
            self.velocity + t * (self.acceleration + t * self.jerk / 2),
            self.acceleration + t * self.jerk,
            self.jerk,
        )


class Motion(NamedTuple):
    """Position and its derivatives at one time."""

    position: float
    """[unit]"""
    velocity: float
    """[unit/s]"""
    acceleration: float
    """[unit/s^2]"""
    jerk: float
    """[unit/s^3]"""


class Part(NamedTuple):
    """A part of a motion that an input shaper makes later."""

    part: float
    """Of the whole."""
    delay: float
    """[s]"""


@dataclass(frozen=True)
class Plan:
    """What move_to() or move_by() would do now, as Axis.plan() returns it. Positions are those of the motor: with a
    backlash they differ from the joint's by the part that is taken up."""

    axis: str
    """The name of the axis."""
    unit: str
    """``m`` or ``rad``."""
    target: float
    """[unit] the commanded position."""
    rest: float
    """[unit] the microstep nearest to it."""
    duration: float
    """[s]"""
    overshoot: float
    """[unit] beyond the target, if the axis can't stop before it."""
    steps_per_unit: float
    """[microsteps/unit] in the present microstep mode."""
    pieces: Tuple[Piece, ...]
    """The motion as it was planned; empty if nothing would move."""
    parts: Tuple[Part, ...]
    """The axis moves by the sum of these parts of the pieces; empty if motions aren't shaped."""

    def at(self, time: float) -> Motion:
        """The motion at a time [s] after its begin, as it is on the pins: shaped, if an input shaper is configured.

        Before its begin and after its end the axis is taken to be at rest.
        """
        return self._at(time, time)

    def _at(self, time: float, within: float) -> Motion:
        """The motion at a time, as it is in the piece of another time: pieces meet at jumps."""
        parts = self.parts or (Part(1.0, 0.0),)
        motions = [(part.part, self._planned(time - part.delay, within - part.delay)) for part in parts]
        return Motion(*(sum(share * own[i] for share, own in motions) for i in range(4)))

    def _planned(self, time: float, within: float) -> Motion:
        if not self.pieces:
            return Motion(self.rest, 0.0, 0.0, 0.0)
        if within < 0.0:
            return Motion(self.pieces[0].position, 0.0, 0.0, 0.0)
        begin = 0.0
        for piece in self.pieces:
            if within < begin + piece.duration:
                return piece.at(time - begin)
            begin += piece.duration
        last = self.pieces[-1]
        return Motion(last.at(last.duration).position, 0.0, 0.0, 0.0)

    def _joints(self) -> List[float]:
        """[s] The times at which a piece or a part begins or ends."""
        begins = [0.0]
        for piece in self.pieces:
            begins.append(begins[-1] + piece.duration)
        return sorted({begin + part.delay for begin in begins for part in self.parts or (Part(1.0, 0.0),)})

    def sample(self, per_piece: int = 50) -> Tuple[List[float], List[Motion]]:
        """Times [s] and the motions at them, ``per_piece`` of each piece with both of its ends."""
        times: List[float] = []
        motions: List[Motion] = []
        joints = self._joints()
        for begin, end in zip(joints, joints[1:]):
            for i in range(per_piece):
                time = begin + (end - begin) * i / max(1, per_piece - 1)
                times.append(time)
                motions.append(self._at(time, (begin + end) / 2))
        return times, motions

    def plot(self, figure: Any = None) -> Figure:
        """Draws position, velocity and acceleration over time, by matplotlib (``apt install python3-matplotlib``).

        figure: a matplotlib Figure to draw into; None: a new one, which ``savefig("move.svg")`` writes to a file.
        """
        if figure is None:
            from matplotlib.figure import Figure

            figure = Figure(figsize=(6.4, 6.4), layout="constrained")
        times, motions = self.sample()
        rows = (
            (f"position [{self.unit}]", [motion.position for motion in motions]),
            (f"velocity [{self.unit}/s]", [motion.velocity for motion in motions]),
            (f"acceleration [{self.unit}/s^2]", [motion.acceleration for motion in motions]),
        )
        graphs = figure.subplots(len(rows), sharex=True)
        for graph, (label, values) in zip(graphs, rows):
            graph.plot(times, values)
            graph.set_ylabel(label)
            graph.grid(True, color="#dddddd")
        graphs[0].set_title(f"{self.axis} to {self.target:g} {self.unit} in {self.duration:.3f} s")
        graphs[-1].set_xlabel("time [s]")
        return typing.cast("Figure", figure)
