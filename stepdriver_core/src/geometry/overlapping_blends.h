#pragma once

#include <cstddef>
#include <vector>

namespace stepdriver::motion {

/// The distance of a corner from its rounding, m(0)/d, for a shift of 1: see Path.
constexpr double kMidRounding = 3.0 / 8.0;

/// Corners of lines, one after the other, whose roundings may overlap, see Path.
class OverlappingBlends {
 public:
  /// @param begin [unit] of the first line, and `end` of the last one: no rounding is beyond them.
  OverlappingBlends(double begin, double end) : begin_(begin), end_(end) {}

  /// @param length of the line before it. @param turn sin(turn/2). @param distance of its rounding
  ///   if it overlaps no other one. @param fixed its rounding can't be changed. @param kept [unit]
  ///   the part of the line that is kept as it is, apart from fixed roundings.
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
    double begin;  // no rounding before it, if it isn't fixed
    bool fixed;
    double taken = 0.0;  // of the tolerance, by fixed roundings
  };

  std::size_t firstNear(std::size_t corner) const;
  std::size_t lastNear(std::size_t corner) const;
  double turnsWithin(std::size_t index, double distance) const;
  // Fixed roundings leave less of the tolerance to the others. If corners have been added near a
  // fixed one, their roundings don't overlap with it: others did already.
  void yieldToFixed();
  bool allows(std::size_t index, double distance) const;
  void widen(std::size_t index);
  // Of the roundings where their sum exceeds a tolerance. Returns whether none did.
  bool narrow();

  double begin_;
  double end_;
  std::vector<Corner> corners_;
};

}  // namespace stepdriver::motion
