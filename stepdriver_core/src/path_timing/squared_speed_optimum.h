#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "acceleration_limited.h"
#include "limit_usage.h"

namespace stepdriver::motion {

/// The derivatives of the position of an axis with respect to the length of its path.
struct PathDerivatives {
  double first = 0.0;
  double second = 0.0;  ///< [1/unit]
  double third = 0.0;   ///< [1/unit^2]
};

/// The fastest motion from rest to rest along a path that is divided into pieces, within limits of
/// speed, acceleration and jerk.
///
/// The unknown is x = s'^2 as a function of the length s. It is a quadratic in each piece, and its
/// slope is continuous: on a straight line, the acceleration x'/2 is continuous and the jerk
/// sqrt(x) x''/2 changes little within a piece. The first and the last piece have a constant jerk,
/// from and to rest: x grows with the power 4/3 of the distance there. The coefficients of x in the
/// pieces are those of a quadratic B-spline: three neighbours make one piece.
///
/// The duration is convex in the coefficients, and the limits of speed and acceleration are linear.
/// Those of jerk are
///
///     |q''' x + 3/2 q'' x' + 1/2 q' x''| sqrt(x) <= j
///
/// at both ends of each piece. The sum of the duration and of the logarithms of what is left of
/// all limits is minimized with falling weights of the logarithms, by Newton's method without what
/// isn't convex in the limits of jerk (J. Nocedal and S. Wright, Numerical Optimization, chapter
/// 19). Its matrix has five diagonals, so that a step takes a time that is linear in the pieces.
class SquaredSpeedOptimum {
 public:
  /// @param limits one for each axis; outlives this.
  explicit SquaredSpeedOptimum(const std::vector<TimingLimits>& limits) : limits_(limits) {}

  /// @param length above 0 [unit]. @param cap [unit^2/s^2] of x. @param ends for each axis at the
  ///   begin of the piece, then for each at its end.
  void append(double length, double cap, const std::vector<PathDerivatives>& ends);

  /// Begins with another motion. There are at least three pieces.
  ///
  /// @param middles x in the middle of each piece, above 0. It is slowed down until it is within
  ///   the limits.
  void begin(const std::vector<double>& middles);
  /// Finds the optimum from the motion so far.
  void solve();
  /// Divides the limits of a piece by the parts of them that the motion uses, for the next solve().
  void tighten(std::size_t piece, const LimitUsage& usage);

  std::size_t size() const { return lengths_.size(); }
  /// [unit^2/s^2] x at the begin of a piece; with the index size(), at the end.
  double square(std::size_t place) const;
  /// [unit/s^2] The acceleration along the path there.
  double acceleration(std::size_t place) const;
  /// [s] Of the motion along a piece.
  double duration(std::size_t piece) const;

 private:
  using Three = std::array<double, 3>;
  // A row is a sum of three neighbouring coefficients: those around a piece.
  struct Jerk {
    std::size_t piece;
    Three square;  // x at an end of the piece
    Three rate;    // the jerk over its limit, without the factor sqrt(x)
  };
  struct Linear {
    std::size_t piece;
    bool of_speed;
    Three row;
    double most;   // the inverse of the limit of the row, which is infinite if this is 0
    double least;  // the same for the negative row
  };
  // x and its slope at a place, as sums of the coefficients before and after it.
  struct Place {
    std::array<double, 2> square{};
    std::array<double, 2> slope{};
  };

  void findPlaces();
  void findRows();
  void appendJerk(std::size_t piece, bool at_end, const Three& bend);
  static double at(std::size_t piece, const Three& row, const std::vector<double>& x) {
    return row[0] * x[piece] + row[1] * x[piece + 1] + row[2] * x[piece + 2];
  }
  static Three around(bool at_end, const std::array<double, 2>& two);
  double timeOf(const std::vector<double>& x) const;
  double sumOf(const std::vector<double>& x, double weight) const;
  bool improve(double weight);
  void solveForChange();

  const std::vector<TimingLimits>& limits_;
  std::vector<double> lengths_;
  std::vector<double> caps_;
  std::vector<std::size_t> first_jerk_;  // the first row of each piece
  std::vector<std::size_t> first_linear_;
  std::vector<PathDerivatives>
      ends_;  // those of all axes at the begin and at the end of each piece
  std::vector<Place> places_;
  std::vector<Three> middles_;  // the row of x in the middle of each piece
  std::vector<Jerk> jerks_;
  std::vector<Linear> linears_;
  // The coefficients. One more at both ends is 0, and so are those of the first and the last piece,
  // which follow from those of their neighbours.
  std::vector<double> x_;
  std::vector<double> next_;
  std::vector<double> gradient_;
  std::array<std::vector<double>, 3> matrix_;
  std::vector<double> change_;
  double gap_ = 0.0;  // the first gap of the next solve()
};

}  // namespace stepdriver::motion
