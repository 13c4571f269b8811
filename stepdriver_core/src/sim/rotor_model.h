#pragma once

#include <cstdint>
#include <limits>

#include "sim_time.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

constexpr double kPi = 3.14159265358979323846;

/// The rotor of a hybrid stepper in the field of its coils.
///
/// With e the electrical angle by which the field leads the rotor, w the frequency of its small
/// oscillations, d their damping ratio and f the friction as a part of the holding torque:
///
///     rotor'' = w^2 (sin e - f sign(rotor')) - 2 d w rotor'
///
/// The torque repeats with each electrical cycle of four full steps. A rotor that gets further away
/// from the field than half a cycle is pulled to the next cycle: it has lost four full steps.
///
/// Between two steps the field stands still. That time is divided into steps of at most a quarter
/// of 1/w: half of the way, then the torque there for the whole step, with the damping solved
/// exactly, then the other half of the way. That is stable for all parameters (up to 2/w without
/// damping), and the frequency is right to 0.3 %. A rotor that has settled costs nothing.
class RotorModel {
 public:
  explicit RotorModel(const MotorSpec& spec);

  /// The rotor turns until this time, and the field stands still.
  /// @return by how many electrical cycles it has fallen behind the field meanwhile; negative: it
  ///   has overtaken the field.
  std::int64_t turnTo(std::int64_t time_ns);
  /// Enough time has passed for turnTo() to be worth while.
  bool isDue(std::int64_t time_ns) const { return !settled_ && elapsed(time_ns) >= kLongestStep; }
  /// A step. @pre turnTo() its time @param angle [electrical rad]
  void moveField(double angle);

  /// The coils have another current from now on. @param part of the holding torque, above 0
  void setTorque(double part);

  /// The rotor is blocked at both ends of its way: the field leads it by at least `least` and at
  /// most `most` [electrical rad]. Both move with the field. It doesn't bounce.
  void setStops(double least, double most);

  /// Nothing turns the rotor: it stands where the field was.
  void rest(std::int64_t time_ns);
  /// The field catches a rotor that stands still, this far behind it. That is no lag behind steps.
  /// @param angle [electrical rad]
  void snap(double angle, std::int64_t time_ns);

  /// [electrical rad] By how much the field leads the rotor.
  double lag() const { return lag_; }
  /// [electrical rad] The largest lag in either direction, at most half a cycle.
  double largestLag() const;
  /// How often it has fallen out of step, by an electrical cycle each time.
  std::int64_t slips() const { return slips_; }

 private:
  static constexpr double kLongestStep = 0.25;  // in units of 1/w

  /// In units of 1/w.
  double elapsed(std::int64_t time_ns) const {
    return static_cast<double>(time_ns - time_ns_) * 1e-9 * frequency_;
  }
  void turn(double duration, double decay, double gain);
  void meetStops();
  void noteLag();
  std::int64_t slip();
  void settle();

  const double full_frequency_;  // [rad/s] with the whole holding torque
  const double full_friction_;   // in parts of the holding torque
  const double damping_;
  double torque_ = 1.0;  // the part of it that the present current makes
  double frequency_;     // the same two with the present current
  double friction_;
  double lag_ = 0.0;                                             // [electrical rad]
  double least_lag_ = -std::numeric_limits<double>::infinity();  // at the stops
  double most_lag_ = std::numeric_limits<double>::infinity();
  double speed_ = 0.0;  // the rotor's speed, in units of w
  double largest_lag_ = 0.0;
  std::int64_t slips_ = 0;
  std::int64_t time_ns_ = kForEver;
  bool settled_ = true;
  bool follows_ = false;  // steps, and doesn't snap
};

}  // namespace stepdriver::sim
