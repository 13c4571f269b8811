#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace stepdriver::search {

/// The places that the requests to an axis lead to, and those that its pulses lead to.
///
/// The hull grows with each request and with what its answer announces, and begins again when a
/// request comes while the axis rests. Pulses may come before their answer, so places are compared
/// with the hull only when there is no open call.
class Hull {
 public:
  /// It rests here. @param tolerance how far pulses may be outside, in the unit of all places
  void begin(double place, double tolerance) {
    lowest_ = highest_ = low_ = high_ = place;
    tolerance_ = tolerance;
  }

  /// A request may lead here.
  void allow(double place) { allow(place, place); }
  void allow(double low, double high) {
    low_ = std::min(low_, low);
    high_ = std::max(high_, high);
  }
  void allowAnything() {
    allow(-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity());
  }
  void widen(double tolerance) { tolerance_ = std::max(tolerance_, tolerance); }

  /// A pulse has led here.
  void pass(double place) {
    lowest_ = std::min(lowest_, place);
    highest_ = std::max(highest_, place);
  }

  /// What is wrong, in words; empty if nothing is.
  std::string broken() const {
    const double below = low_ - tolerance_ - lowest_;
    const double above = highest_ - (high_ + tolerance_);
    if (!(below > 0.0) && !(above > 0.0)) return "";
    return "was from " + std::to_string(lowest_) + " to " + std::to_string(highest_) +
           ", but its requests lead from " + std::to_string(low_) + " to " + std::to_string(high_);
  }

 private:
  double lowest_ = 0.0;
  double highest_ = 0.0;
  double low_ = 0.0;
  double high_ = 0.0;
  double tolerance_ = 0.0;
};

}  // namespace stepdriver::search
