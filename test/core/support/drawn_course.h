#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "stepdriver_core/trajectory/requests.h"

// The geometry of a path as its caller gave it, computed again without the product's code.

namespace stepdriver::test {

/// A segment of a path in up to three linear axes [m].
class DrawnSegment {
 public:
  using Point = std::array<double, 3>;
  using Shape = motion::PathSegment::Shape;

  static DrawnSegment line(const Point& from, const Point& to) {
    DrawnSegment made(Shape::kLine, from, to);
    return made.measured();
  }
  static DrawnSegment bezier(const Point& from, const Point& control1, const Point& control2,
                             const Point& to) {
    DrawnSegment made(Shape::kBezier, from, to);
    made.control1_ = control1;
    made.control2_ = control2;
    return made.measured();
  }
  /// In the plane of the first two axes; the third one moves in proportion to the angle.
  static DrawnSegment arc(const Point& from, const std::array<double, 2>& centre, double angle,
                          double rise) {
    DrawnSegment made(Shape::kArcAround, from, from);
    made.centre_ = centre;
    made.angle_ = angle;
    made.end_[2] += rise;
    made.end_ = made.at(1.0);
    return made.measured();
  }

  Shape shape() const { return shape_; }
  double length() const { return lengths_.back(); }
  const Point& end() const { return end_; }
  /// At least the way of a unit of the parameter, anywhere.
  double longest() const {
    double most = length();
    for (std::size_t i = 0; i <= kParts; ++i) {
      most = std::max(most, 1.1 * sizeOf(slope(static_cast<double>(i) / kParts)));
    }
    return most;
  }

  Point at(double u) const {
    Point point;
    const double v = 1.0 - u;
    for (std::size_t k = 0; k < 3; ++k) {
      point[k] = shape_ == Shape::kBezier ? v * v * v * from_[k] + 3.0 * v * v * u * control1_[k] +
                                                3.0 * v * u * u * control2_[k] + u * u * u * end_[k]
                                          : from_[k] + u * (end_[k] - from_[k]);
    }
    if (shape_ == Shape::kArcAround) {
      const double x = from_[0] - centre_[0];
      const double y = from_[1] - centre_[1];
      point[0] = centre_[0] + x * std::cos(u * angle_) - y * std::sin(u * angle_);
      point[1] = centre_[1] + x * std::sin(u * angle_) + y * std::cos(u * angle_);
    }
    return point;
  }
  /// The derivative of at().
  Point slope(double u) const {
    Point slope;
    const double v = 1.0 - u;
    for (std::size_t k = 0; k < 3; ++k) {
      slope[k] = shape_ == Shape::kBezier ? 3.0 * v * v * (control1_[k] - from_[k]) +
                                                6.0 * v * u * (control2_[k] - control1_[k]) +
                                                3.0 * u * u * (end_[k] - control2_[k])
                                          : end_[k] - from_[k];
    }
    if (shape_ == Shape::kArcAround) {
      const Point point = at(u);
      slope[0] = -angle_ * (point[1] - centre_[1]);
      slope[1] = angle_ * (point[0] - centre_[0]);
    }
    return slope;
  }
  Point direction(double u) const {
    Point slope = this->slope(u);
    const double size = sizeOf(slope);
    for (double& x : slope) x /= size;
    return slope;
  }
  /// The way from its begin.
  double distance(double u) const {
    const auto part = std::min(static_cast<std::size_t>(u * kParts), kParts - 1);
    const double from = static_cast<double>(part) / kParts;
    return lengths_[part] + wayBetween(from, u);
  }

  motion::PathSegment segment(std::size_t axes) const {
    const auto numbers = [axes](const Point& point) {
      return std::vector<double>(point.begin(), point.begin() + static_cast<std::ptrdiff_t>(axes));
    };
    motion::PathSegment segment;
    segment.shape = shape_;
    segment.end = numbers(end_);
    if (shape_ == Shape::kBezier) {
      segment.control1 = numbers(control1_);
      segment.control2 = numbers(control2_);
    }
    if (shape_ == Shape::kArcAround) {
      segment.plane = {"x", "y"};
      segment.point = centre_;
      segment.clockwise = angle_ < 0.0;
    }
    return segment;
  }

  static double sizeOf(const Point& point) {
    return std::sqrt(point[0] * point[0] + point[1] * point[1] + point[2] * point[2]);
  }

 private:
  static constexpr std::size_t kParts = 64;

  DrawnSegment(Shape shape, const Point& from, const Point& to)
      : shape_(shape), from_(from), end_(to) {}

  DrawnSegment& measured() {
    lengths_ = {0.0};
    for (std::size_t i = 0; i < kParts; ++i) {
      lengths_.push_back(lengths_.back() + wayBetween(static_cast<double>(i) / kParts,
                                                      static_cast<double>(i + 1) / kParts));
    }
    return *this;
  }
  // Gauss's rule with 5 points.
  double wayBetween(double from, double to) const {
    constexpr std::array<std::pair<double, double>, 3> kRule{
        {{0.0, 128.0 / 225.0},
         {0.5384693101056831, 0.4786286704993665},
         {0.9061798459386640, 0.2369268850561891}}};
    const double middle = (from + to) / 2.0;
    const double half = (to - from) / 2.0;
    double sum = kRule[0].second * sizeOf(slope(middle));
    for (std::size_t i = 1; i < kRule.size(); ++i) {
      const auto& [at, weight] = kRule[i];
      sum += weight * (sizeOf(slope(middle - half * at)) + sizeOf(slope(middle + half * at)));
    }
    return half * sum;
  }

  Shape shape_;
  Point from_;
  Point end_;
  Point control1_{};
  Point control2_{};
  std::array<double, 2> centre_{};
  double angle_ = 0.0;
  std::vector<double> lengths_;  // at the begin of each part, and all of it
};

}  // namespace stepdriver::test
