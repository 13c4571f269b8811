import unittest

from support import ramp
from stepdriver_plots.step_curve import StepCurve, differences
from stepdriver_plots.summary import summary


def trapezoid_of_edges():
    """2400 steps: up to 8000 steps/s within 400 steps, and down again."""
    up = ramp(400, 80000.0)
    times = up + [0.1 + (i + 0.5) / 8000.0 for i in range(1600)] + [0.4 - time for time in reversed(up)]
    return StepCurve.of_counts([round(time, 9) for time in times], list(range(1, 2401)), "x", "mm", 0.0125)


class StepCurveTest(unittest.TestCase):
    def test_finds_speed_and_acceleration_of_a_ramp_from_its_edges(self):
        curve = StepCurve.of_counts(ramp(1000, 2000.0), list(range(1, 1001)))
        times, speeds = curve.speed()
        for time, speed in zip(times[5:], speeds[5:]):
            self.assertAlmostEqual(speed, 2000.0 * time, delta=1e-6 * speed)
        for acceleration in curve.acceleration()[1][5:]:
            self.assertAlmostEqual(acceleration, 2000.0, delta=0.1)

    def test_has_no_rate_of_change_between_times_that_are_the_same_number(self):
        self.assertEqual(differences([1.0, 1.0, 2.0], [0.0, 1.0, 3.0]), ([1.5], [2.0]))

    def test_scales_to_a_unit(self):
        curve = StepCurve.of_counts([0.0, 0.01, 0.02], [1, 2, 3], "x", "mm", 0.5)
        self.assertEqual(curve.position()[1], [0.25, 0.75, 1.25])
        self.assertEqual(curve.speed()[1], [50.0, 50.0])
        self.assertEqual(curve.period_over_position(), ([0.5, 1.0], [10000.0, 10000.0]))

    def test_begins_at_the_count_before_its_first_edge(self):
        curve = StepCurve.of_counts([0.0, 0.01, 0.02], [501, 502, 503], first=500)
        self.assertEqual(curve.position()[1], [500.5, 501.5, 502.5])
        self.assertEqual(curve.speed()[1], [100.0, 100.0])
        self.assertEqual(summary(curve), ": 3 pulses in 0.02 s, from 500 to 503 steps (least 500, greatest 503 steps), "
                                         "at most 100 steps/s")

    def test_says_in_one_line_what_an_axis_did(self):
        times = ramp(800, 2000.0)
        counts = list(range(1, 801))
        curve = StepCurve.of_counts(times, counts, "x", "mm", 0.0125)
        self.assertEqual(summary(curve), "x: 800 pulses in 0.872 s, from 0 to 10 mm (least 0, greatest 10 mm), at most "
                                         "22.35 mm/s (1,788 steps/s)")

    def test_finds_out_whether_the_acceleration_jumps(self):
        self.assertFalse(trapezoid_of_edges().has_jerk_limit)
        # A jerk of 6e5 steps/s^3, one third of the way.
        smooth = [round((i + 0.5) ** (1.0 / 3.0) / 100.0, 9) for i in range(3000)]
        self.assertTrue(StepCurve.of_counts(smooth, list(range(1, 3001))).has_jerk_limit)

    def test_stands_where_no_step_comes(self):
        curve = StepCurve.of_counts([0.0, 0.01, 1.0, 1.01], [1, 2, 3, 4])
        times, speeds = curve.speed()
        self.assertEqual(speeds[1:3], [0.0, 0.0])
        self.assertTrue(0.01 < times[1] < times[2] < 1.0)
        periods = curve.period_over_position()[1]
        self.assertNotEqual(periods[1], periods[1], "the line breaks off")

    def test_has_no_acceleration_and_no_jerk_over_a_standstill(self):
        times = ramp(100, 2000.0)
        times += [times[-1] + 1.0 + time for time in times]
        curve = StepCurve.of_counts(times, list(range(1, 201)))
        for at, values in (curve.acceleration(), curve.jerk()):
            self.assertFalse([time for time, value in zip(at, values)
                              if times[99] < time < times[100] and value == value])
            self.assertEqual(len([value for value in values if value != value]), 1, "one gap")
        for acceleration in [value for value in curve.acceleration()[1] if value == value]:
            self.assertAlmostEqual(acceleration, 2000.0, delta=200.0)

    def test_turns_where_the_count_does(self):
        speeds = StepCurve.of_counts([0.0, 0.01, 0.02, 0.03], [1, 2, 1, 0]).speed()[1]
        self.assertGreater(speeds[0], 0.0)
        self.assertEqual(speeds[1], 0.0, "on the same half-step line both times")
        self.assertLess(speeds[2], 0.0)

    def test_jerk_is_above_the_noise_of_whole_nanoseconds(self):
        times = [round(time, 9) for time in ramp(20000, 100000.0)]
        curve = StepCurve.of_counts(times, list(range(1, 20001))).coarse(250)
        self.assertLess(len(curve.times), 260)
        self.assertEqual((curve.times[0], curve.times[-1]), (times[0], times[-1]))
        for jerk in curve.jerk()[1][2:]:
            self.assertAlmostEqual(jerk, 0.0, delta=0.1 * 100000.0 / times[-1])

    def test_coarse_keeps_begin_and_end_of_each_motion(self):
        times = [i * 0.001 for i in range(100)] + [1.0 + i * 0.001 for i in range(100)]
        coarse = StepCurve.of_counts(times, list(range(1, 201))).coarse(10)
        for wanted in (times[0], times[99], times[100], times[199]):
            self.assertIn(wanted, coarse.times)
        self.assertLess(len(coarse.times), 30)

    def test_motions_of_a_long_recording_have_accelerations(self):
        up = ramp(500, 4000.0)  # 2000 steps/s within 0.5 s
        motion = up + [1.0 - time for time in reversed(up)]
        times = [10.0 * number + time for number in range(50) for time in motion]
        coarse = StepCurve.of_counts(times, list(range(1, len(times) + 1))).coarse(250)
        values = [value for value in coarse.acceleration()[1] if value == value]
        self.assertGreater(len(values), 50 * 200)
        self.assertAlmostEqual(max(values), 4000.0, delta=40.0)
        self.assertAlmostEqual(min(values), -4000.0, delta=40.0)
        # In a motion of 60 s the samples are farther apart than a rest is long.
        long = [times[-1] + 10.0 + 60.0 * time for time in motion]
        coarse = StepCurve.of_counts(times + long, list(range(1, len(times + long) + 1))).coarse(250)
        self.assertGreater(len([at for at, value in zip(*coarse.acceleration())
                                if value == value and at > long[0]]), 200)


if __name__ == "__main__":
    unittest.main()
