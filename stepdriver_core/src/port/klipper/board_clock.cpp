#include "port/klipper/board_clock.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::klipper {
namespace {

// [ns] In this time conversions get from the old estimate to the new one: within a change of 20 us
// the rate of the steps changes by 10 ppm, which no motor notices.
constexpr Nanoseconds kConvergence = 2'000'000'000;
// A quartz and a RC oscillator are within this of their nominal frequency; what is beyond is a
// wrong answer, and not a clock.
constexpr double kMostDrift = 0.05;
// The frequencies of boards deviate by about this from their nominal ones: a quartz by less, a
// ceramic resonator by more.
constexpr double kDeviation = 1e-3;
// [ns] Weights of answers with a shorter round trip don't grow any more.
constexpr double kShortestHalf = 1'000.0;

double seconds(Nanoseconds time) { return static_cast<double>(time) * 1e-9; }

}  // namespace

BoardClock::BoardClock(double frequency) : nominal_(frequency), frequency_(frequency) {}

void BoardClock::add(const Sample& sample) {
  const Nanoseconds middle = sample.sent + (sample.received - sample.sent) / 2;
  const std::int64_t tick =
      samples_ == 0 ? std::int64_t{sample.ticks} : widened(sample.ticks, middle);
  points_.at(samples_ % kPoints) = {middle, (sample.received - sample.sent) / 2, tick};
  ++samples_;
  estimate();
  is_newer_ = true;
}

void BoardClock::estimate() {
  const std::size_t count = std::min(samples_, kPoints);
  const Point& newest = points_.at((samples_ - 1) % kPoints);
  double weights = 0.0;
  double mean_time = 0.0;
  double mean_tick = 0.0;
  const auto weight_of = [](const Point& point) {
    const double half = std::max(kShortestHalf, static_cast<double>(point.half));
    return 1.0 / (half * half);
  };
  // Ticks as deviations from the nominal line through the newest point: these are small.
  const auto deviation_of = [&](const Point& point) {
    return static_cast<double>(point.tick - newest.tick) -
           seconds(point.time - newest.time) * nominal_;
  };
  Nanoseconds quickest = newest.half;
  for (std::size_t i = 0; i < count; ++i) {
    const Point& point = points_.at(i);
    const double weight = weight_of(point);
    weights += weight;
    mean_time += weight * seconds(point.time - newest.time);
    mean_tick += weight * deviation_of(point);
    quickest = std::min(quickest, point.half);
  }
  mean_time /= weights;
  mean_tick /= weights;
  double covariance = 0.0;
  double variance = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Point& point = points_.at(i);
    const double weight = weight_of(point);
    const double off = seconds(point.time - newest.time) - mean_time;
    covariance += weight * off * (deviation_of(point) - mean_tick);
    variance += weight * off * off;
  }
  // What is known before any answer weighs as much as an answer about the frequency with that
  // deviation: few answers that took long say less than the nominal value.
  const double information = variance + 1e-18 / (kDeviation * kDeviation);
  const double slope =
      std::clamp(covariance / information, -kMostDrift * nominal_, kMostDrift * nominal_);
  frequency_deviation_ = 1e-9 / std::sqrt(information);
  mean_time_ = newest.time + std::llround(mean_time * 1e9);
  frequency_ = nominal_ + slope;
  time_ = newest.time;
  whole_ = newest.tick;
  tick_ = mean_tick - slope * mean_time;
  double residuals = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Point& point = points_.at(i);
    const double line = tick_ + slope * seconds(point.time - newest.time);
    const double off = deviation_of(point) - line;
    residuals += weight_of(point) * off * off;
  }
  const double deviation = std::sqrt(residuals / weights) / nominal_ * 1e9;
  uncertainty_ = quickest + static_cast<Nanoseconds>(std::ceil(deviation));
}

Nanoseconds BoardClock::uncertaintyAt(Nanoseconds time) const {
  const double off = std::abs(static_cast<double>(time - mean_time_));
  return uncertainty_ + std::llround(frequency_deviation_ * off);
}

std::int64_t BoardClock::estimateAt(Nanoseconds time) const {
  return whole_ + std::llround(tick_ + seconds(time - time_) * frequency_);
}

std::int64_t BoardClock::widened(std::uint32_t ticks, Nanoseconds near) const {
  const std::int64_t expected = estimateAt(near);
  const auto off = static_cast<std::int32_t>(ticks - static_cast<std::uint32_t>(expected));
  return expected + off;
}

Nanoseconds BoardClock::timeOf(std::int64_t tick) const {
  const double ticks = static_cast<double>(tick - whole_) - tick_;
  return time_ + std::llround(ticks / frequency_ * 1e9);
}

std::int64_t BoardClock::tickAt(Nanoseconds time) {
  if (settles_ || is_newer_) {
    const Nanoseconds from = settles_ ? time : std::max(time, last_);
    const double estimate = tick_ + seconds(from - time_) * frequency_;
    if (settles_) {
      from_whole_ = whole_;
      from_tick_ = estimate;
      rate_ = frequency_ * 1e-9;
    } else {
      const double now = from_tick_ + static_cast<double>(from - from_) * rate_;
      const double behind = static_cast<double>(whole_ - from_whole_) + estimate - now;
      const double whole = std::floor(now);
      from_whole_ += static_cast<std::int64_t>(whole);
      from_tick_ = now - whole;
      rate_ = frequency_ * 1e-9 + behind / static_cast<double>(kConvergence);
      // Whatever the answers say, time doesn't run backward.
      rate_ = std::clamp(rate_, 0.5e-9 * nominal_, 2e-9 * nominal_);
    }
    from_ = from;
    settles_ = is_newer_ = false;
  }
  last_ = std::max(last_, time);
  return from_whole_ + std::llround(from_tick_ + static_cast<double>(time - from_) * rate_);
}

}  // namespace stepdriver::klipper
