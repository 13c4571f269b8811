#include "read_scale.h"

#include <fmt/format.h>

#include <limits>
#include <string>
#include <vector>

#include "bounds.h"
#include "message_text.h"

namespace stepdriver::config {
namespace {

constexpr int kMostFullSteps = 1'000'000;

const char* const kFullSteps = "full_steps_per_round";
const char* const kGear = "gear_ratio";
const char* const kStepsPerRound = "steps_per_round";

class ScaleReader {
 public:
  ScaleReader(ConfigReader& axis, const MotionKeys& keys, const Rounds& rounds, Presence presence)
      : axis_(axis), keys_(keys), rounds_(rounds), presence_(presence) {}

  /// @return [microsteps/unit]; empty if a key that it needs is missing or wrong.
  std::optional<long double> read() {
    const std::vector<std::string> by_rounds = givenOfRounds();
    if (axis_.has(keys_.steps_per_unit) || by_rounds.empty()) return readDirectScale(by_rounds);
    const std::optional<long double> per_round = readTravel(presence_);
    if (presence_ == Presence::kRequired && !axis_.has(kFullSteps)) {
      axis_.issue(kFullSteps,
                  "is missing; it must be an integer of 1 or more, as the axis is scaled by " +
                      by_rounds.front());
    }
    if (!rounds_.full_steps || !rounds_.gear || !per_round || !rounds_.microsteps) return {};
    return static_cast<long double>(*rounds_.full_steps) * *rounds_.microsteps * *rounds_.gear /
           *per_round;
  }

  /// Whether the motion can count with this scale.
  bool check(long double scale) {
    if (scale * kSlack >= kLowestScale && scale <= kHighestScale * kSlack) return true;
    std::string key = kFullSteps;
    for (const std::string& other :
         {std::string(kGear), keys_.per_round, keys_.wheel_diameter, keys_.steps_per_unit}) {
      if (scaleIsGivenBy(other)) key = other;
    }
    axis_.issue(key, fmt::format("is {}, which makes {} steps per {}, but must make from {} to {}",
                                 axis_.shown(key), roughText(static_cast<double>(scale)),
                                 keys_.unit, numberText(kLowestScale), numberText(kHighestScale)));
    return false;
  }

 private:
  bool scaleIsGivenBy(const std::string& key) const { return !key.empty() && axis_.has(key); }

  /// The given keys of a scale by revolutions.
  std::vector<std::string> givenOfRounds() const {
    std::vector<std::string> given;
    for (const std::string& key :
         {std::string(kFullSteps), keys_.per_round, keys_.wheel_diameter, std::string(kGear)}) {
      if (scaleIsGivenBy(key)) given.push_back(key);
    }
    return given;
  }

  /// @return [unit] travel per revolution of the gear's output; empty if it is missing or wrong.
  std::optional<long double> readTravel(Presence presence) {
    if (keys_.per_round.empty()) return keys_.units_per_round;
    const bool by_wheel = axis_.has(keys_.wheel_diameter);
    const bool by_travel = axis_.has(keys_.per_round);
    if (!by_wheel && !by_travel && presence == Presence::kRequired) {
      axis_.issue(keys_.per_round,
                  fmt::format("is missing; it must be a number above 0, or else {} must be given",
                              keys_.wheel_diameter));
    }
    const auto travel = axis_.findNumber(keys_.per_round, Range::positive(), Presence::kOptional);
    const auto diameter =
        axis_.findNumber(keys_.wheel_diameter, Range::positive(), Presence::kOptional);
    if (by_wheel && by_travel) {
      axis_.contradiction(keys_.wheel_diameter,
                          fmt::format("is {}, but {} must not be given with it: a revolution "
                                      "travels either that or pi times the diameter",
                                      axis_.shown(keys_.wheel_diameter), keys_.per_round));
      return {};
    }
    if (diameter) return kPi * static_cast<long double>(*diameter);
    return travel;
  }

  /// @param by_rounds the given keys of the other way to scale the axis, which are not allowed
  ///   here.
  std::optional<long double> readDirectScale(const std::vector<std::string>& by_rounds) {
    const std::string& key = keys_.steps_per_unit;
    if (!axis_.has(key)) {
      if (presence_ == Presence::kRequired) {
        const std::string travel =
            keys_.per_round.empty()
                ? ""
                : fmt::format(" and {} or {}", keys_.per_round, keys_.wheel_diameter);
        axis_.issue(
            key, fmt::format("is missing; it must be a number above 0, or else {}{} must be given",
                             kFullSteps, travel));
      }
      return {};
    }
    const auto scale = axis_.findNumber(key, Range::positive(), presence_);
    if (by_rounds.empty()) return scale;
    readTravel(Presence::kOptional);
    axis_.contradiction(
        key, fmt::format("is {}, but {} must not be given with it: the axis is scaled by "
                         "either (the motor's own steps can be given as {})",
                         axis_.shown(key), listText(by_rounds, "and"), kStepsPerRound));
    return {};
  }

  ConfigReader& axis_;
  const MotionKeys& keys_;
  const Rounds& rounds_;
  Presence presence_;
};

double readStepsPerRound(ConfigReader& axis, std::optional<int> full_steps,
                         std::optional<int> microsteps) {
  const auto steps =
      axis.findInteger(kStepsPerRound, 1, std::numeric_limits<int>::max(), Presence::kOptional);
  const bool by_full_steps = full_steps && microsteps;
  const int product = by_full_steps ? *full_steps * *microsteps : 0;
  if (steps && by_full_steps && *steps != product) {
    axis.contradiction(
        kStepsPerRound,
        fmt::format("is {}, but must be {}: {} ({}) times microsteps ({})",
                    axis.shown(kStepsPerRound), product, kFullSteps, *full_steps, *microsteps));
  } else if (steps && microsteps && *steps % *microsteps != 0) {
    axis.contradiction(kStepsPerRound,
                       fmt::format("is {}, but must be a multiple of microsteps, which is "
                                   "{}: it counts the microsteps of whole full steps",
                                   axis.shown(kStepsPerRound), *microsteps));
  }
  return steps.value_or(product);
}

}  // namespace

Rounds readRounds(ConfigReader& axis, std::optional<int> microsteps) {
  Rounds rounds;
  rounds.microsteps = microsteps;
  rounds.full_steps = axis.findInteger(kFullSteps, 1, kMostFullSteps, Presence::kOptional);
  rounds.gear = axis.findNumber(kGear, Range::positive(), Presence::kOptional);
  if (!axis.has(kGear)) rounds.gear = 1.0;
  rounds.steps = readStepsPerRound(axis, rounds.full_steps, microsteps);
  return rounds;
}

std::optional<long double> readScale(ConfigReader& axis, const MotionKeys& keys,
                                     const Rounds& rounds, Presence presence) {
  ScaleReader reader(axis, keys, rounds, presence);
  const std::optional<long double> scale = reader.read();
  if (scale && presence == Presence::kRequired && !reader.check(*scale)) return {};
  return scale;
}

}  // namespace stepdriver::config
