#include "translator.h"

#include <cmath>
#include <numeric>

#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::motor {

bool Translator::isAtHome(std::int64_t count) const { return placeAt(count) == 0; }

std::int64_t Translator::placeAt(std::int64_t count) const {
  const std::int64_t cycle = static_cast<std::int64_t>(driver::kFullStepsPerCycle) * microsteps_;
  const std::int64_t place = (count - home_count_) % cycle;
  return place < 0 ? place + cycle : place;
}

std::int64_t Translator::nearestCommon(std::int64_t count, int wanted) const {
  const std::int64_t index = count - home_count_;
  if (driver::keepsPosition(index, microsteps_, wanted)) return count;
  const double unit = static_cast<double>(microsteps_) / std::gcd(microsteps_, wanted);
  return home_count_ + std::llround(std::round(static_cast<double>(index) / unit) * unit);
}

Translator::Change Translator::changeTo(int wanted, std::int64_t count) const {
  Change change;
  change.microsteps = wanted;
  change.home_stays = home_count_ * wanted % microsteps_ == 0;
  change.home_count = change.home_stays ? home_count_ * wanted / microsteps_ : 0;
  change.count = change.home_count + (count - home_count_) * wanted / microsteps_;
  return change;
}

void Translator::changed(const Change& change) {
  microsteps_ = change.microsteps;
  home_count_ = change.home_count;
}

}  // namespace stepdriver::motor
