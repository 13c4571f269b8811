#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "activity/context.h"
#include "activity/input_edges.h"

namespace stepdriver::machine {

/// Looks for lost steps: an axis that has been homed to a flag passes it again, and the flag's edge
/// is compared with its place at the homing. Edges that the homing hasn't passed count from the
/// first passing on.
class FlagChecks {
 public:
  /// An edge that came elsewhere, or didn't come.
  struct Finding {
    axis::AxisModel* axis = nullptr;
    std::string text;  ///< "lost steps: the flag home came 0.4 mm early"
  };

  FlagChecks() = default;
  /// @param axes outlive it.
  explicit FlagChecks(const std::vector<std::unique_ptr<axis::AxisModel>>& axes);

  /// Something may have happened.
  /// @param is_homing whether an axis is being homed.
  std::vector<Finding> poll(const activity::Context& context,
                            const std::function<bool(const axis::AxisModel&)>& is_homing);
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  /// Clock time until which all reported edges must be known; pulse::kNever: none is waited for.
  pulse::Nanoseconds edgesDue() const;
  /// Whether it uses the levels of inputs now.
  bool areWatched() const;

 private:
  struct Check {
    Check(axis::AxisModel& checked, std::string its_flag, activity::InputEdges its_edges,
          pulse::Nanoseconds debounce);

    axis::AxisModel* axis;
    std::string flag;
    activity::InputEdges edges;
    pulse::Nanoseconds debounce;
    pulse::Nanoseconds delay;  ///< an edge is known so long after its time, if there was one
    bool is_on = false;
    int microsteps = 0;  ///< the mode in which it was turned on
    pulse::Nanoseconds began = 0;
    /// By direction and level as FlagPlaces: the axis is before this edge, which must come.
    std::array<bool, 4> expected{};
    std::array<pulse::Nanoseconds, 4> seen{};  ///< the last edge
    pulse::Nanoseconds looked = 0;
    pulse::Nanoseconds edges_due = pulse::kNever;  ///< for the next look
    pulse::Nanoseconds watched_until = 0;
  };

  static void turnOn(const activity::Context& context, Check& check);
  static void turnOff(Check& check);
  static void look(const activity::Context& context, Check& check, std::vector<Finding>& findings);
  static void judge(const activity::Context& context, const activity::InputEdges::Edge& edge,
                    Check& check, std::vector<Finding>& findings);
  static void lookForMissing(const activity::Context& context, Check& check,
                             std::vector<Finding>& findings);

  std::deque<Check> checks_;
};

}  // namespace stepdriver::machine
