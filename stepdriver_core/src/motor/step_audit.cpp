#include "step_audit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "driver/tmc_registers.h"

namespace stepdriver::motor {
namespace {

namespace tmc = driver::tmc;

/// [1/256 full step] By how much MSCNT is ahead if it grows with the count (1) or against it (-1).
std::int64_t excessOf(int sign, std::int64_t heard, std::int64_t sent) {
  constexpr std::int64_t kCycle = tmc::kMscntPerCycle;
  const std::int64_t rest = ((sign * heard - sent) % kCycle + kCycle) % kCycle;
  return rest > kCycle / 2 ? rest - kCycle : rest;
}

/// [1/256 full step] In the electrical cycle.
std::int64_t wayOf(std::int64_t steps, int microsteps) {
  const std::int64_t unit = tmc::kFinest / microsteps;
  return steps % (tmc::kMscntPerCycle / unit) * unit;
}

}  // namespace

void StepAudit::begin(int mscnt, std::int64_t count) {
  begun_ = true;
  mscnt_ = mscnt;
  count_ = count;
}

std::string StepAudit::check(int mscnt, std::int64_t count, int microsteps) {
  if (!begun_) {
    begin(mscnt, count);
    return "";
  }
  const std::int64_t unit = tmc::kFinest / microsteps;
  const std::int64_t heard = mscnt - mscnt_;
  const std::int64_t sent = wayOf(count - count_, microsteps);
  const std::int64_t with = excessOf(1, heard, sent);
  const std::int64_t against = excessOf(-1, heard, sent);
  if (sign_ == 0 && (with == 0) != (against == 0)) sign_ = with == 0 ? 1 : -1;
  const bool grows = sign_ == 0 ? std::abs(with) <= std::abs(against) : sign_ > 0;
  const std::int64_t differs = grows ? with : against;
  if (differs == 0) return "";
  end();
  const std::int64_t number = std::max<std::int64_t>((std::abs(differs) + unit / 2) / unit, 1);
  return fmt::format("is {} step{} {} the pulses that were sent", number, number == 1 ? "" : "s",
                     sign_ == 0    ? "away from"
                     : differs > 0 ? "ahead of"
                                   : "behind");
}

std::optional<int> StepAudit::mscntAt(std::int64_t count, int microsteps) const {
  constexpr std::int64_t kCycle = tmc::kMscntPerCycle;
  const std::int64_t sent = wayOf(count - count_, microsteps);
  const bool is_the_same = 2 * sent % kCycle == 0;
  if (!begun_ || (sign_ == 0 && !is_the_same)) return {};
  const std::int64_t forward = sign_ < 0 ? -sent : sent;
  return static_cast<int>(((mscnt_ + forward) % kCycle + kCycle) % kCycle);
}

}  // namespace stepdriver::motor
