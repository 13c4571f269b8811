"""Position, speed, acceleration and jerk of recorded joint states."""

from .step_curve import REST, differences


class JointCurve:
    """A joint of sensor_msgs/JointState: positions and speeds at times [s]."""

    def __init__(self, times, places, speeds, label="", unit="m", step=None):
        """step: the size of a microstep in the unit, if it is known."""
        self.times = times
        self.places = places
        self.speeds = speeds
        self.label = label
        self.unit = unit
        self.step = step
        self.stands = places

    samples = "joint states"
    has_jerk_limit = True  # joint states can't show that there is none

    def coarse(self, _samples):
        return self

    def position(self):
        return self.times, self.places

    def speed(self):
        return self.times, self.speeds

    def acceleration(self):
        return differences(self.times, self.speeds)

    def jerk(self):
        return differences(*self.acceleration())

    def speed_over_position(self):
        return self.places, self.speeds

    def period_over_position(self):
        """[us] from step to step, while the joint moves."""
        moving = [(p, v) for p, v in zip(self.places, self.speeds) if abs(v) * REST >= self.step]
        return [p for p, _ in moving], [self.step / abs(v) * 1e6 for _, v in moving]
