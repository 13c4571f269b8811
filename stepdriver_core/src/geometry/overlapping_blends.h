#pragma once

#include <cstddef>
#include <vector>

namespace stepdriver::motion {

/// The distance of a corner from the middle of its rounding, m(0)/d, for a shift of 1; see Path.
constexpr double kMidRounding = 3.0 / 8.0;

/// The corners between consecutive lines, whose roundings may overlap; see Path.
class OverlappingBlends {
 public:
  /// @param begin, end [unit] the begin of the first line and the end of the last one: no rounding
  /// reaches beyond them.
  OverlappingBlends(double begin, double end) : begin_(begin), end_(end) {}

  /// Adds a corner.
  ///
  /// @param length the length of the line before it
  /// @param turn sin(turn/2)
  /// @param distance how far its rounding reaches if it overlaps no other one
  /// @param fixed whether its rounding can't be changed
  /// @param kept [unit] the part of the line that stays as it is, apart from fixed roundings
  void append(double length, double turn, double distance, double tolerance, bool fixed,
              double kept);

  /// The distances of all roundings, as wide as the tolerances and the other roundings allow. Call
  /// it once.
  std::vector<double> widened();

 private:
  struct Corner {
    double place;  // [unit] along the lines
    double turn;
    double least;
    double distance;
    double tolerance;
    double begin;  // the rounding begins after this place, unless it is fixed
    bool fixed;
    double taken = 0.0;  // the part of the tolerance that fixed roundings use
  };

  std::size_t firstNear(std::size_t corner) const;
  std::size_t lastNear(std::size_t corner) const;
  double turnsWithin(std::size_t index, double distance) const;
  // Fixed roundings leave less of the tolerance to the others. If corners have been added near a
  // fixed one, their roundings don't overlap with it: others did already.
  void yieldToFixed();
  bool allows(std::size_t index, double distance) const;
  void widen(std::size_t index);
  // Narrows the roundings at the places at which their sum exceeds a tolerance. Returns whether it
  // exceeded none.
  bool narrow();

  double begin_;
  double end_;
  std::vector<Corner> corners_;
};

}  // namespace stepdriver::motion
