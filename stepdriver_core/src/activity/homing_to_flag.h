#pragma once

#include <optional>
#include <string>
#include <vector>

#include "debounced_input.h"
#include "homing.h"

namespace stepdriver::activity {

/// A homing to a flag: a switch that is no limit, and that the axis passes on both sides. The axis
/// passes the flag's edge slowly, always from the same side, without stopping at it: the trigger
/// point is where it was planned to be at the edge's time. An endstop on the way is a turning
/// point.
///
/// kFlagCentre: the trigger point is the middle of the flag, of its edges in both directions, so
/// that the hysteresis of the switch cancels. kIndex: after the edge of a flag, or at once if there
/// is none, it continues to the edge of an index pulse that comes once a turn of the motor.
class HomingToFlag final : public Homing {
 public:
  HomingToFlag(Context& context, axis::AxisModel& axis, std::uint64_t id,
               std::shared_ptr<Result> outcome);
  ~HomingToFlag() override { axis_.motor.unwatchMotions(); }
  HomingToFlag(const HomingToFlag&) = delete;
  HomingToFlag& operator=(const HomingToFlag&) = delete;

  bool watchesInputs() const override { return !isHeld() || axis_.moving(); }

 protected:
  void start() override;
  void strokeEnded() override;
  void look(bool stroke_has_ended) override;
  void observe() override;
  pulse::Nanoseconds lookDue() const override;
  std::string unmet() const override;

 private:
  /// An edge of the flag, or of the index, that the axis has passed.
  struct Edge {
    bool active = false;
    double place = 0.0;     ///< [microsteps] of the joint
    bool was_read = false;  ///< no edge was reported: its place is only known roughly
  };

  void seek(axis::HomingPhase phase, double direction);
  void goOn();
  void slowDown();
  bool hasLeft() const;
  /// Looks for the edges of a latch. @return whether all of them have been passed.
  bool hasLatched();
  void settled();
  void latched();
  bool edgeWasLost() const;
  void approachAgain();
  void metEndstop(bool at_max);
  double placeAt(pulse::Nanoseconds clock_time) const;
  std::optional<Edge> indexEdge() const;
  std::string sensor() const { return "the input " + flag_name_; }
  double turn() const;  // [microsteps] of the motor
  std::string indexWarning() const;
  void keepPlaces();

  const bool has_flag_;
  const std::string flag_name_;
  DebouncedInput flag_;  // the index, if there is no flag

  double direction_ = 0.0;
  bool began_active_ = false;  // the flag was, when the phase began
  bool slowing_ = false;
  int approaches_ = 0;           // whose edges the kernel has not reported
  bool returns_ = false;         // it has turned at an endstop before it has met the flag
  std::vector<Edge> passed_;     // edges of the flag in this phase
  std::vector<double> centre_;   // [microsteps] edges for the middle of the flag
  axis::FlagPlaces places_;      // [microsteps] all edges of the flag that it has passed
  std::optional<double> edge_;   // [microsteps] the flag's
  std::optional<double> index_;  // [microsteps]
  double trigger_ = 0.0;         // [microsteps]
};

}  // namespace stepdriver::activity
