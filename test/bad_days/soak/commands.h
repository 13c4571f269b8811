#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/random_motion.h"

namespace stepdriver::soak {

/// How far from 0 the axes of a soak are sent [m].
constexpr double kReach = 0.09;

/// How often each kind of command was accepted and refused.
struct Accepted {
  std::int64_t accepted = 0;
  std::int64_t refused = 0;
};
using Counts = std::map<std::string, Accepted>;

/// A client that sends random commands of every kind to a machine. For one thread.
class RandomCommands {
 public:
  /// @param axes the names of the axes to command.
  RandomCommands(machine::Machine& machine, std::vector<std::string> axes, unsigned seed)
      : machine_(machine), names_(std::move(axes)), random_(seed) {}

  /// Sends one, or a path and what is appended to it. A refusal is an answer like any other. @throw
  /// Error of any other kind
  void send();

  const Counts& counts() const { return counts_; }
  motion::Random& random() { return random_; }

 private:
  bool send(const std::string& kind);  ///< @return whether it was accepted
  std::string choose();
  std::string chooseKind();
  bool isAtRest() const;
  double place() { return random_.within(-kReach, kReach); }
  double velocity(const axis::Axis& axis);
  axis::Axis& anyAxis();
  /// @param begin_in [s] whatever the axes do until then
  void trajectory(double begin_in);
  void beginPath();
  void appendToPath();

  machine::Machine& machine_;
  const std::vector<std::string> names_;
  motion::Random random_;
  Counts counts_;
  std::uint64_t path_ = 0;  // the last one; 0: there was none
  bool path_is_due_ = false;
};

}  // namespace stepdriver::soak
