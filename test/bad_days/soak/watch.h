#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "commands.h"

namespace stepdriver::soak {

/// What a soak has found so far.
struct Findings {
  std::uint64_t edges = 0;
  std::int64_t violations = 0;  ///< chips' times that the other side of the lines saw violated
  std::int64_t mismatches = 0;  ///< positions that weren't the counts of the edges
  std::int64_t errors = 0;      ///< anything else that must not happen

  bool good() const { return violations + mismatches + errors == 0; }
};

/// Prints a line each minute, and a summary.
class Watch {
 public:
  /// @param warm [s] after this time everything has been allocated once: from then on memory and
  ///   descriptors must be flat.
  explicit Watch(double warm);

  /// To be called often. Prints a line if a minute has passed.
  void look(const Findings& findings);

  /// @return the exit code: 0 if nothing was found, and memory and descriptors are flat.
  int conclude(const Findings& findings, const Counts& counts);

  double seconds() const;

 private:
  void print(const Findings& findings);

  const double warm_;
  const std::chrono::steady_clock::time_point begin_;
  int minutes_ = 0;
  std::uint64_t edges_printed_ = 0;
  double printed_at_ = 0.0;
  std::int64_t first_kilobytes_ = 0;
  std::int64_t first_descriptors_ = 0;
};

}  // namespace stepdriver::soak
