#include "overlapping_blends.h"

#include <algorithm>
#include <cmath>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr int kMostPasses = 30;
constexpr int kHalvings = 30;
constexpr std::size_t kMostNeighbours = 32;  // on each side of a corner
constexpr double kMostTurning = 0.5;
constexpr double kInside = 1.0 - 1e-9;  // keeps rounding errors from passing an end

// (m(w) - |w|)/d as a function of y = |w|/d.
double roundingAt(double y) {
  return y < 1.0 ? kMidRounding + y * y * (0.75 - 0.125 * y * y) - y : 0.0;
}

}  // namespace

void OverlappingBlends::append(double length, double turn, double distance, double tolerance,
                               bool fixed, double kept) {
  const double before = corners_.empty() ? 0.0 : corners_.back().place;
  if (kept > 0.0) begin_ = std::max(begin_, before + kept);
  corners_.push_back({before + length, turn, distance, distance, tolerance, begin_, fixed});
}

std::vector<double> OverlappingBlends::widened() {
  end_ += corners_.back().place;
  yieldToFixed();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    giveWay(i);
    widen(i);
  }
  bool fits = false;
  for (int i = 0; i < kMostPasses && !fits; ++i) fits = narrow();
  std::vector<double> distances;
  for (const Corner& corner : corners_) {
    distances.push_back(fits ? corner.distance : corner.least);
  }
  return distances;
}

std::size_t OverlappingBlends::firstNear(std::size_t corner) const {
  return corner - std::min(corner, kMostNeighbours);
}

std::size_t OverlappingBlends::lastNear(std::size_t corner) const {
  return std::min(corner + kMostNeighbours, corners_.size() - 1);
}

double OverlappingBlends::turnsWithin(std::size_t index, double distance) const {
  double turns = 0.0;
  for (std::size_t i = firstNear(index); i <= lastNear(index); ++i) {
    if (std::abs(corners_[i].place - corners_[index].place) < distance) turns += corners_[i].turn;
  }
  return turns;
}

void OverlappingBlends::yieldToFixed() {
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    if (!corners_[k].fixed || corners_[k].distance == 0.0) continue;
    const Corner& fixed = corners_[k];
    for (std::size_t i = firstNear(k); i <= lastNear(k); ++i) {
      Corner& other = corners_[i];
      if (other.fixed || other.turn == 0.0) continue;
      const double away = std::abs(other.place - fixed.place);
      other.taken += fixed.turn * fixed.distance * roundingAt(away / fixed.distance);
    }
  }
  for (Corner& corner : corners_) {
    if (corner.fixed || corner.turn == 0.0) continue;
    const double most = std::max(0.0, corner.tolerance - corner.taken);
    corner.least = corner.distance = std::min(corner.least, most / (kMidRounding * corner.turn));
  }
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    const Corner& fixed = corners_[k];
    if (!fixed.fixed || turnsWithin(k, 2.0 * fixed.distance) <= kMostTurning) continue;
    for (std::size_t i = k + 1; i <= lastNear(k); ++i) {
      Corner& other = corners_[i];
      const double end = fixed.place + fixed.distance;
      other.begin = std::max(other.begin, std::min(end, other.place - other.least));
    }
  }
}

bool OverlappingBlends::allows(std::size_t index, double distance) const {
  const Corner& corner = corners_[index];
  double deviation = 0.0;
  for (std::size_t i = firstNear(index); i <= lastNear(index); ++i) {
    const double away = std::abs(corners_[i].place - corner.place);
    deviation += corners_[i].turn * distance * roundingAt(away / distance);
  }
  return turnsWithin(index, 2.0 * distance) <= kMostTurning && deviation <= corner.tolerance;
}

void OverlappingBlends::widen(std::size_t index) {
  Corner& corner = corners_[index];
  if (corner.turn == 0.0 || corner.fixed) return;
  // The rounding reaches at most half as far as the last neighbours that are counted.
  double high = kInside * std::min(corner.place - corner.begin, end_ - corner.place);
  if (index >= kMostNeighbours) {
    high = std::min(high, (corner.place - corners_[firstNear(index)].place) / 2.0);
  }
  if (index + kMostNeighbours < corners_.size()) {
    high = std::min(high, (corners_[lastNear(index)].place - corner.place) / 2.0);
  }
  double low = corner.distance;
  for (int i = 0; i < kHalvings && low < high; ++i) {
    const double middle = (low + high) / 2.0;
    (allows(index, middle) ? low : high) = middle;
  }
  corner.distance = low;
}

bool OverlappingBlends::narrow() {
  bool fits = true;
  std::vector<double> factors(corners_.size(), 1.0);
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    if (corners_[k].turn == 0.0) continue;
    double deviation = 0.0;
    for (std::size_t i = firstNear(k); i <= lastNear(k); ++i) {
      const double away = std::abs(corners_[i].place - corners_[k].place);
      deviation +=
          corners_[i].turn * corners_[i].distance * roundingAt(away / corners_[i].distance);
    }
    constexpr double kRounding = 1e-9;
    if (deviation <= corners_[k].tolerance * (1.0 + kRounding)) continue;
    fits = false;
    const double factor = std::sqrt(corners_[k].tolerance / deviation);
    for (std::size_t i = firstNear(k); i <= lastNear(k); ++i) {
      if (std::abs(corners_[i].place - corners_[k].place) < corners_[i].distance) {
        factors[i] = std::min(factors[i], factor);
      }
    }
  }
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    if (corners_[i].fixed) continue;
    corners_[i].distance = std::max(corners_[i].least, corners_[i].distance * factors[i]);
  }
  return fits;
}

}  // namespace stepdriver::motion
