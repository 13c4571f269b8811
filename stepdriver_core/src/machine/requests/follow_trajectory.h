#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "request_context.h"
#include "trajectory/prepared_trajectory.h"
#include "trajectory/queued_path.h"

namespace stepdriver::machine {

/// Machine::followTrajectory() and Machine::followPath()
struct FollowTrajectory {
  std::vector<AxisId> axes;
  /// nullptr if something has ended the preparation: the request is refused for that, or outdated.
  std::shared_ptr<const motion::PreparedTrajectory> prepared;
  /// AxisState::stops of each axis at the time of the request: if one was stopped since, it isn't
  /// begun.
  std::vector<std::uint64_t> stops;
  /// What is known about a path, of which this is the trajectory.
  struct Path {
    std::vector<double> from;     ///< [microsteps] AxisSnapshot::rest of each axis
    std::vector<double> targets;  ///< [microsteps] the commanded positions at its end
    /// If more segments follow.
    std::shared_ptr<const motion::PathWindow> window;
  };
  std::optional<Path> path{};
  std::int64_t begins_ns = 0;  ///< motion time at which it takes over; 0: at once

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
