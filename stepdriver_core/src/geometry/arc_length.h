#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "path.h"

namespace stepdriver::motion {

/// The distances along a segment of a path as it is given, without its rounded corners: the root of
/// the sum of the squared ways of some axes.
class ArcLength {
 public:
  /// @param measured the axes that count; empty: all of them.
  ArcLength(const Path& path, std::size_t segment, std::vector<bool> measured);

  /// [unit] Of the whole segment.
  double length() const { return lengths_.back(); }
  /// Where the segment is at a distance from its begin: 0 to 1. Empty: it is shorter.
  std::optional<double> parameterAt(double distance) const;

 private:
  double rateAt(double parameter) const;
  double between(double from, double to) const;

  const Path& path_;
  const std::size_t segment_;
  const std::vector<bool> measured_;
  std::vector<double> lengths_;  // from the begin to the end of each part
};

}  // namespace stepdriver::motion
