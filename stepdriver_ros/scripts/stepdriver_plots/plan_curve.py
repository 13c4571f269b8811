"""Position, speed, acceleration and jerk of a planned move, from its cubic pieces."""

from collections import namedtuple

Piece = namedtuple("Piece", "duration position velocity acceleration jerk")
SAMPLES = 200  # for each piece
SAME = 1e-12  # [s] a piece that isn't longer is only a rounding error


class PlanCurve:
    """The pieces of a move from the service plan: duration, position, velocity, acceleration and jerk
    of each."""

    def __init__(self, pieces, label="", unit="m", step=None):
        """step: the size of a microstep in the unit."""
        self.label = label
        self.unit = unit
        self.step = step
        self.pieces = [piece for piece in pieces if piece.duration > 0.0]
        self.starts = [0.0]
        for piece in self.pieces:
            self.starts.append(self.starts[-1] + piece.duration)

    def scaled(self, factor, unit):
        """The same move in another unit. factor: how many of it are one of this curve's unit."""
        pieces = [Piece(piece.duration, piece.position * factor, piece.velocity * factor,
                        piece.acceleration * factor, piece.jerk * factor) for piece in self.pieces]
        step = None if self.step is None else self.step * factor
        return PlanCurve(pieces, self.label, unit, step)

    def shaped(self, parts, delays, label=""):
        """The sum of parts of this move, each later by its delay [s], as an input shaper makes it."""
        ends = sorted(start + delay for start in self.starts for delay in delays)
        pieces = []
        for begin, end in zip(ends, ends[1:]):
            if end - begin < SAME:
                continue
            state = [0.0] * 4
            for part, delay in zip(parts, delays):
                value = self._from(begin - delay, (begin + end) / 2 - delay)
                state = [total + part * own for total, own in zip(state, value)]
            pieces.append(Piece(end - begin, *state))
        return PlanCurve(pieces, label, self.unit, self.step)

    def _from(self, time, within):
        """Position, velocity, acceleration and jerk at a time, as they are in the piece of another time."""
        if within < 0.0 or not self.pieces:
            return (self.pieces[0].position if self.pieces else 0.0), 0.0, 0.0, 0.0
        for start, piece in zip(self.starts, self.pieces):
            if within < start + piece.duration:
                t = time - start
                return (place(piece, t), speed(piece, t), piece.acceleration + piece.jerk * t,
                        piece.jerk)
        last = self.pieces[-1]
        return place(last, last.duration), 0.0, 0.0, 0.0

    samples = None  # It isn't recorded.

    @property
    def has_jerk_limit(self):
        """If false, the acceleration jumps from one piece to the next."""
        return any(piece.jerk != 0.0 for piece in self.pieces)

    def coarse(self, _samples):
        return self

    def _over_time(self, value, samples=SAMPLES):
        at, values = [], []
        for start, piece in zip(self.starts, self.pieces):
            for i in range(samples + 1):
                t = piece.duration * i / samples
                at.append(start + t)
                values.append(value(piece, t))
        return at, values

    def position(self):
        return self._over_time(place)

    def speed(self):
        return self._over_time(speed)

    def acceleration(self):
        return self._over_time(lambda piece, t: piece.acceleration + piece.jerk * t, 1)

    def jerk(self):
        if not self.has_jerk_limit:
            return [], []
        return self._over_time(lambda piece, _: piece.jerk, 1)

    def speed_over_position(self):
        return self.position()[1], self.speed()[1]

    def period_over_position(self):
        """[us] from step to step, except within one step of a position of rest."""
        places, speeds = self.speed_over_position()
        peak = max((abs(s) for s in speeds), default=0.0)
        rests = [p for p, s in zip(places, speeds) if abs(s) <= 1e-9 * peak]
        at, periods = [], []
        for p, s in zip(places, speeds):
            if all(abs(p - rest) >= self.step for rest in rests):
                at.append(p)
                periods.append(self.step / abs(s) * 1e6)
        return at, periods


def place(piece, t):
    return piece.position + t * (piece.velocity + t * (piece.acceleration / 2 + t * piece.jerk / 6))


def speed(piece, t):
    return piece.velocity + t * (piece.acceleration + t * piece.jerk / 2)
