#include "sim/rotor_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "support/constants.h"

namespace stepdriver::sim {
namespace {

using test::kPi;

constexpr double kFullStep = kPi / 2.0;

double degrees(double angle) { return angle * 180.0 / kPi; }
double frequencyOf(const MotorSpec& motor) {
  return std::sqrt(motor.pole_pairs * motor.holding_torque / motor.inertia);
}

/// A common motor with little damping.
MotorSpec motor(double friction = 0.0, double damping = 0.05) {
  MotorSpec spec;
  spec.friction = friction * spec.holding_torque;
  spec.damping = damping;
  return spec;
}

/// A field that turns in microsteps, and the rotor in it.
class Field {
 public:
  explicit Field(const MotorSpec& spec, int microsteps = 16)
      : rotor(spec), microsteps_(microsteps) {
    rotor.rest(0);
  }

  void stepAt(double time, int direction = 1) {
    wait(time);
    rotor.moveField(direction * kFullStep / microsteps_);
  }
  void wait(double until) { behind += rotor.turnTo(std::llround(until * 1e9)); }

  /// From standstill at once. @return the time of the end
  double turn(double begin, double full_steps_per_second, int full_steps, int direction = 1) {
    const double rate = full_steps_per_second * microsteps_;
    const int steps = full_steps * microsteps_;
    for (int i = 1; i <= steps; ++i) stepAt(begin + i / rate, direction);
    return begin + steps / rate;
  }
  /// From rest to a speed with an acceleration, and back to rest.
  double ramps(double acceleration, int full_steps) {
    const int steps = full_steps * microsteps_;
    const double half = std::sqrt(full_steps / acceleration);
    for (int i = 1; i <= steps; ++i) {
      const double way = (i - 0.5) / microsteps_;
      const double left = full_steps - way;
      stepAt(way < left ? std::sqrt(2.0 * way / acceleration)
                        : 2.0 * half - std::sqrt(2.0 * left / acceleration));
    }
    return 2.0 * half;
  }

  RotorModel rotor;
  std::int64_t behind = 0;  // electrical cycles

 private:
  int microsteps_;
};

TEST(RotorModel, LagsBehindByTheAngleWhoseTorqueTurnsTheLoad) {
  for (const double load : {0.1, 0.4, 0.6, 0.9}) {
    Field field(motor(load), 256);
    double end = 0.0;
    for (int i = 1; i <= 256 * 100; ++i) field.stepAt(end = i / (256 * 20.0));
    EXPECT_NEAR(degrees(field.rotor.lag()), degrees(std::asin(load)), 1.0) << load;
    EXPECT_EQ(field.rotor.slips(), 0);
    field.wait(end + 10.0);
    EXPECT_LE(std::abs(std::sin(field.rotor.lag())), load + 1e-4)
        << "it rests where friction holds it";
  }
}

// With the damping d, the speed w: 2 d speed/w^2 of the torque.
TEST(RotorModel, LagsBehindByTheAngleThatTheDampingTakes) {
  const MotorSpec spec = motor(0.0, 0.1);
  Field field(spec, 256);
  const double rate = 500.0;
  double end = 0.0;
  for (int i = 1; i <= 256 * 500; ++i) {
    const double ramp = 0.2;  // s
    const double way = i / 256.0;
    const double ramps_way = rate * ramp / 2.0;
    end = way < ramps_way ? std::sqrt(2.0 * way * ramp / rate) : ramp + (way - ramps_way) / rate;
    field.stepAt(end);
  }
  const double drag = 2.0 * 0.1 * kFullStep * rate / frequencyOf(spec);
  EXPECT_NEAR(degrees(field.rotor.lag()), degrees(std::asin(drag)), 0.5);
}

TEST(RotorModel, SwingsAtTheFrequencyOfItsLinearisedEquation) {
  const MotorSpec spec = motor(0.0, 0.01);
  Field field(spec, 100);
  field.stepAt(0.0);
  std::vector<double> crossings;
  double before = field.rotor.lag();
  double time = 0.0;
  while (crossings.size() < 41) {
    time += 1e-6;
    field.wait(time);
    if ((before > 0.0) != (field.rotor.lag() > 0.0)) crossings.push_back(time);
    before = field.rotor.lag();
  }
  const double frequency = 20.0 * 2.0 * kPi / (crossings.back() - crossings.front());
  EXPECT_NEAR(frequency, frequencyOf(spec), 1e-3 * frequency) << "sqrt(p T/J), in rad/s";
}

TEST(RotorModel, LosesThePartOfAnAmplitudeThatItsDampingTakes) {
  for (const double damping : {0.01, 0.05, 0.3}) {
    const MotorSpec spec = motor(0.0, damping);
    Field field(spec, 50);
    field.stepAt(0.0);
    const double begin = field.rotor.lag();
    const double of_critical = std::sqrt(1.0 - damping * damping);
    field.wait(2.0 * kPi / (of_critical * frequencyOf(spec)));
    const double part = std::exp(-2.0 * kPi * damping / of_critical);
    EXPECT_NEAR(field.rotor.lag() / begin, part, 0.005) << damping;
  }
}

/// Kinetic and potential energy.
TEST(RotorModel, GainsNoEnergyWhileTheFieldStandsStill) {
  for (const double damping : {0.001, 0.05, 1.0, 10.0}) {
    const MotorSpec spec = motor(0.0, damping);
    Field field(spec, 1);
    field.stepAt(0.0);
    double highest = 0.0;
    double amplitude = kFullStep;
    for (int swing = 1; swing <= 40; ++swing) {
      highest = 0.0;
      for (int i = 0; i < 400; ++i) {
        field.wait((swing * 400 + i) * 2.5e-3 * 2.0 * kPi / frequencyOf(spec));
        highest = std::max(highest, std::abs(field.rotor.lag()));
      }
      EXPECT_LE(highest, amplitude * 1.002) << damping << ", swing " << swing;
      amplitude = highest;
    }
    EXPECT_EQ(field.rotor.slips(), 0);
  }
}

TEST(RotorModel, FollowsARampWithinItsTorque) {
  const MotorSpec spec = motor(0.0, 0.01);
  const double strongest = frequencyOf(spec) * frequencyOf(spec) / kFullStep;
  Field gentle(spec);
  gentle.wait(gentle.ramps(0.3 * strongest, 40) + 1.0);
  EXPECT_EQ(gentle.rotor.slips(), 0);
  EXPECT_EQ(gentle.behind, 0);
  // The field begins to accelerate all at once, so the lag overshoots to twice asin(0.3).
  EXPECT_NEAR(degrees(gentle.rotor.largestLag()), 2.0 * degrees(std::asin(0.3)), 20.0);
  EXPECT_EQ(gentle.rotor.lag(), 0.0) << "it has settled where the field is";
}

TEST(RotorModel, FallsOutOfStepOnARampBeyondItsTorque) {
  const MotorSpec spec = motor(0.0, 0.01);
  const double strongest = frequencyOf(spec) * frequencyOf(spec) / kFullStep;
  Field steep(spec);
  steep.wait(steep.ramps(1.1 * strongest, 400) + 1.0);
  EXPECT_GT(steep.behind, 10);
  EXPECT_GE(steep.rotor.slips(), steep.behind);
  EXPECT_DOUBLE_EQ(degrees(steep.rotor.largestLag()), 180.0);
  EXPECT_EQ(steep.rotor.lag(), 0.0) << "it settles on another cycle";
}

// Seen from a field that turns at a speed, the rotor begins at that speed, and the field catches it
// if that is below 2 w.
TEST(RotorModel, StartsAtOnceUpToTwiceItsFrequency) {
  const MotorSpec spec = motor(0.0, 0.01);
  const double pull_in = 2.0 * frequencyOf(spec) / kFullStep;
  for (const double part : {0.5, 0.9, 1.1, 3.0, 300.0}) {
    Field field(spec, 256);
    field.wait(field.turn(0.0, part * pull_in, 400) + 1.0);
    EXPECT_EQ(field.rotor.slips() == 0, part < 1.0)
        << part << " of the pull-in speed: " << field.rotor.slips();
    EXPECT_EQ(field.behind == 0, part < 1.0) << part;
  }
}

TEST(RotorModel, RunsOnIfTheFieldStopsAtATooHighSpeed) {
  const MotorSpec spec = motor();
  Field field(spec);
  double end = 0.0;
  const double speed = 3.0 * frequencyOf(spec) / kFullStep;
  const int steps = 16 * 20'000;
  for (int i = 1; i <= steps; ++i) {
    end = 2.0 * steps / 16.0 / speed * std::sqrt(static_cast<double>(i) / steps);
    field.stepAt(end);
  }
  EXPECT_EQ(field.rotor.slips(), 0) << "until there";
  field.wait(end + 1.0);
  EXPECT_LT(field.behind, 0) << "it has overtaken the field";
  EXPECT_EQ(field.rotor.slips(), -field.behind);
}

TEST(RotorModel, SnapsToTheNearestPlaceWithoutALag) {
  for (const double angle : {-0.999 * kPi, -1.0, 0.5, kPi}) {
    Field field(motor());
    field.rotor.snap(angle, 0);
    field.wait(2.0);
    EXPECT_EQ(field.rotor.lag(), 0.0);
    EXPECT_EQ(field.rotor.slips(), 0);
    EXPECT_EQ(field.rotor.largestLag(), 0.0) << "there was no step";
  }
}

TEST(RotorModel, StaysFiniteAndSettlesForParametersOfAnyMagnitude) {
  std::mt19937 random(7);
  const auto power = [&random](double lowest, double highest) {
    const double part = static_cast<double>(random()) / 4294967296.0;
    return std::pow(10.0, lowest + part * (highest - lowest));
  };
  for (int i = 0; i < 500; ++i) {
    MotorSpec spec;
    spec.pole_pairs = static_cast<int>(power(0, 3));
    spec.holding_torque = power(-6, 6);
    spec.inertia = power(-13, 3);
    spec.friction = i % 3 == 0 ? 0.0 : power(-12, 7);
    spec.damping = power(-2, 1);
    Field field(spec, 1 << random() % 9);
    double time = 0.0;
    const double pause = power(-8, 3);
    for (int step = 0; step < 30; ++step) {
      field.stepAt(time += pause * power(-1, 1), random() % 8 == 0 ? -1 : 1);
      ASSERT_LE(std::abs(field.rotor.lag()), 2.0 * kPi) << i;
    }
    field.wait(9e9);
    const double lag = field.rotor.lag();
    ASSERT_LE(std::abs(lag), 1.5 * kPi) << i;
    if (frequencyOf(spec) < 1e-3) continue;  // it is not over within nine billion seconds
    EXPECT_LE(std::abs(std::sin(lag)), std::min(1.0, spec.friction / spec.holding_torque) + 1e-4);
    const double before = field.rotor.largestLag();
    field.wait(9.1e9);
    EXPECT_EQ(field.rotor.lag(), lag);
    EXPECT_EQ(field.rotor.largestLag(), before);
  }
}

TEST(SoundMotor, LosesNothingWithinTheLimits) {
  for (const double rate : {0.1, 100.0, 1'000.0, 20'000.0, 1e6}) {
    for (const double acceleration : {rate * 0.1, rate * 10.0, rate * 1000.0}) {
      const MotorSpec spec = soundMotor({}, rate, acceleration);
      for (const int microsteps : {1, 2, 16}) {
        for (double part = 0.1; part <= 1.0; part += 0.1) {
          Field field(spec, microsteps);
          double end = field.turn(0.0, part * rate, 50);
          end = field.turn(end, part * rate, 50, -1);
          field.wait(end + 1.0);
          ASSERT_EQ(field.rotor.slips(), 0)
              << rate << " full steps/s at once, part " << part << ", 1/" << microsteps;
        }
        Field field(spec, microsteps);
        field.ramps(acceleration,
                    std::clamp(static_cast<int>(rate * rate / acceleration), 1, 3000));
        ASSERT_EQ(field.rotor.slips(), 0)
            << rate << " full steps/s, " << acceleration << " full steps/s^2, 1/" << microsteps;
      }
    }
  }
}

/// Steps of a cruise that come late now and then.
struct LateSteps {
  double rate;      ///< microsteps/s
  double longest;   ///< [s]
  bool catches_up;  ///< with up to a quarter of a full step; otherwise no interval is below 3/4
};

/// [deg] The largest lag of a common motor with a load.
double worstLag(const LateSteps& late, double load) {
  std::mt19937 random(1);
  const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  Field field(motor(load));
  constexpr double kRamp = 0.5;       // s
  constexpr double kChipTime = 4e-6;  // s, between two steps
  const double interval = 1.0 / late.rate;
  double slid = 0.0;
  double last = 0.0;
  double stalls = 0.0;  // begin of the millisecond that is looked at
  double stall_begin = 0.0;
  double stall_end = 0.0;
  double planned_before = 0.0;
  double worst = 0.0;
  const int ramp_steps = static_cast<int>(late.rate * kRamp / 2.0);
  for (int i = 0; i < ramp_steps + static_cast<int>(2.0 * late.rate); ++i) {
    const double planned = i < ramp_steps ? std::sqrt(2.0 * (i + 0.5) * kRamp / late.rate)
                                          : kRamp + (i - ramp_steps + 0.5) * interval;
    const double due = planned + slid;
    while (stall_end < due) {
      stalls += 1e-3;
      stall_begin = stalls + 1e-3 * uniform();
      const bool is_one = uniform() < 0.05;
      stall_end = is_one ? stall_begin + late.longest * (0.3 + 0.7 * uniform()) : stall_begin;
      if (stalls > due + 1.0) break;
    }
    double at = due >= stall_begin ? std::max(due, stall_end) : due;
    const double own = i > 0 ? planned - planned_before : 1.0;
    at = std::max(at, last + (late.catches_up ? kChipTime : 0.75 * own));
    const double allowed = std::max(own / 4.0, late.catches_up ? 0.25 * 16.0 * own : 0.0);
    slid += std::max(0.0, at - due - allowed);
    field.stepAt(at);
    if (at > 0.1) worst = std::max(worst, std::abs(field.rotor.lag()));
    last = at;
    planned_before = planned;
  }
  EXPECT_EQ(field.rotor.slips(), 0) << late.rate << " steps/s, load " << load;
  return degrees(worst);
}

// A field that waits and then returns to its plan leaves the rotor's lag as it was; if it stays
// behind, the rotor has to lose that angle.
TEST(RotorModel, FeelsLateStepsThatAreCaughtUpLessThanThoseThatSlide) {
  for (const double rate : {8'000.0, 13'000.0}) {
    for (const double load : {0.0, 0.4, 0.6}) {
      const double held_back = worstLag({rate, 300e-6, false}, load);
      const double caught_up = worstLag({rate, 300e-6, true}, load);
      EXPECT_LT(caught_up + 5.0, held_back) << rate << " steps/s, load " << load;
    }
  }
  EXPECT_NEAR(worstLag({8'000.0, 300e-6, false}, 0.4), 45.8, 4.0);
  EXPECT_NEAR(worstLag({8'000.0, 300e-6, true}, 0.4), 34.0, 4.0);
  EXPECT_NEAR(worstLag({13'000.0, 300e-6, false}, 0.6), 77.2, 4.0);
  EXPECT_NEAR(worstLag({13'000.0, 300e-6, true}, 0.6), 53.8, 4.0);
}

}  // namespace
}  // namespace stepdriver::sim
