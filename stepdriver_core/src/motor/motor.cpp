#include "motor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "input_shaping.h"

namespace stepdriver::motor {
namespace {

// Those of the motions after one that the engine has accepted: it may not have begun them yet.
void addAfter(MotionHistory& history, const Motions& motions, std::uint64_t serial,
              const pulse::ChannelState& state) {
  for (const Motion& motion : motions.all()) {
    if (motion.serial <= serial || motion.serial > state.accepted) continue;
    history.add({motion.planned.plan()->startNs(), true, motion.planned});
  }
}

}  // namespace

Motor::Motor(const config::AxisConfig& config, const MotorLines& lines, int channel)
    : channel_(channel),
      lines_(lines),
      is_shared_(config.kinematics != nullptr),
      pins_(config, lines),
      shaper_(inputShaperOf(config)),
      power_(config.idle_action, !pins_.hasEnable()),
      brake_(config, lines),
      translators_(config.motors(), Translator(config.microsteps)) {
  for (std::size_t i = 0; i < lines_.motors(); ++i) {
    const ChipLines& own = lines_.motorAt(i);
    const bool is_known = std::any_of(enables_.begin(), enables_.end(), [&](const auto& enable) {
      return enable.line == own.enable;
    });
    if (own.enable_line && !is_known) {
      enables_.push_back({own.enable, own.enable_line, own.enable_line->join()});
    }
  }
  for (std::size_t i = 0; i < config.motors(); ++i) {
    const config::MotorConfig& motor = config.motorAt(i);
    tmcs_.push_back(motor.tmc ? std::make_unique<TmcChip>(motor) : nullptr);
  }
  noteChips();
}

void Motor::update(const pulse::ChannelState& state) {
  const pulse::ChannelState before = std::exchange(state_, state);
  if (history_.isKept()) remember(before);
  motions_.update(state);
}

MotionHistory::Part Motor::restingPart() const {
  MotionHistory::Part rest;
  rest.from = state_.end_time;
  rest.place = static_cast<double>(state_.count) + state_.between;
  rest.slack = static_cast<double>(state_.slack);
  return rest;
}

void Motor::watchMotions() {
  MotionHistory::Part now = restingPart();
  if (const Motion* motion = motions_.find(state_.following)) {
    now.moved = true;
    now.motion = motion->planned;
    now.from = motion->planned.plan()->startNs();
  }
  const bool is_first = !history_.isKept();
  history_.watch(std::move(now));
  if (is_first) addAfter(history_, motions_, std::max(state_.following, state_.ended), state_);
}

// The counts of another microstep mode are those from now on.
void Motor::remember(const pulse::ChannelState& before) {
  addAfter(history_, motions_, before.accepted, state_);
  if (state_.ended != before.ended || state_.epoch != before.epoch) history_.add(restingPart());
}

motion::PlannedMotion Motor::shaped(motion::Profile plan) const {
  auto shared = std::make_shared<const motion::Profile>(std::move(plan));
  const Motion* before = motions_.latest();
  if (before == nullptr) return {std::move(shared), shaper_};
  return before->planned.takenOverBy(std::move(shared));
}

motion::MotionState Motor::stateAt(std::int64_t at) const {
  if (const Motion* motion = motions_.latest()) return motion->planned.plan()->stateAt(at);
  if (is_shared_) return {state_.rests_at, 0.0, 0.0};
  const motion::DoubleDouble count = motion::fromInteger(state_.count);
  // A stop on a path ends between two microsteps: the next motion continues from there.
  const Motion* last = motions_.find(state_.ended);
  if (last == nullptr || state_.end != pulse::EndReason::kDone) return {count, 0.0, 0.0};
  const motion::DoubleDouble rest = last->planned.plan()->endPosition();
  return {std::abs((rest - count).value()) <= 0.5 ? rest : count, 0.0, 0.0};
}

void Motor::alignTranslator(std::size_t motor) {
  const double microsteps = tmcs_.at(motor)->mscnt() * translators_.at(motor).microsteps();
  const auto index = std::llround(microsteps / driver::tmc::kFinest);
  translators_.at(motor).wentHome(countOf(motor) - index);
  StepAudit& audit = tmcs_.at(motor)->audit();
  audit.end();
  if (tmcs_.at(motor)->standsStill()) audit.begin(tmcs_.at(motor)->mscnt(), countOf(motor));
}

void Motor::noteChips() {
  auto states = std::make_shared<std::vector<driver::DriverState>>();
  for (const auto& chip : tmcs_) {
    if (chip != nullptr) states->push_back(chip->state());
  }
  if (!states->empty()) driver_states_ = std::move(states);
}

void Motor::forgetRegisters() {
  for (const auto& chip : tmcs_) {
    if (chip != nullptr) chip->forget();
  }
  noteChips();
}

std::optional<int> Motor::mscntOf(std::size_t motor) const {
  const Translator& translator = translators_.at(motor);
  if (hasCoils()) {
    const int finest = driver::tmc::kFinest / translator.microsteps();
    return static_cast<int>(translator.placeAt(countOf(motor))) * finest;
  }
  const auto& chip = tmcs_.at(motor);
  if (chip == nullptr) return {};
  return chip->audit().mscntAt(countOf(motor), translators_.at(motor).microsteps());
}

bool Motor::isAtHome(std::size_t motor) const {
  if (tmcs_.at(motor) != nullptr) return mscntOf(motor) == 0;
  return translators_.at(motor).isAtHome(countOf(motor));
}

pulse::CoilCurrent Motor::coilCurrent(bool on) const {
  pulse::CoilCurrent current;
  current.on = on;
  for (std::size_t i = 0; i < translators_.size(); ++i) {
    current.places.at(i) = static_cast<std::uint8_t>(translators_[i].placeAt(countOf(i)));
  }
  return current;
}

void Motor::continueCoils(std::size_t motor, int mscnt) {
  const int finest = driver::tmc::kFinest / translators_.at(motor).microsteps();
  if (mscnt >= 0 && mscnt % finest == 0) {
    translators_.at(motor).wentHome(countOf(motor) - mscnt / finest);
  }
}

bool Motor::areAtHome() const {
  for (std::size_t i = 0; i < translators_.size(); ++i) {
    if (!isAtHome(i)) return false;
  }
  return true;
}

pulse::MotorSet Motor::allMotors() const {
  return static_cast<pulse::MotorSet>(pulse::motorBit(lines_.motors()) - 1);
}

bool Motor::isHeldByOthers(int enable_line) const {
  return std::any_of(enables_.begin(), enables_.end(), [&](const EnableShare& enable) {
    return enable.line == enable_line && enable.shared->isWantedByOthers(enable.number);
  });
}

bool Motor::enableIsHeldByOthers() const {
  return !enables_.empty() &&
         std::all_of(enables_.begin(), enables_.end(),
                     [&](const EnableShare& enable) { return isHeldByOthers(enable.line); });
}

PinSequence Motor::enable(bool on) const {
  PinSequence sequence = pins_.enable(on, [&](int line) { return on || !isHeldByOthers(line); });
  if (hasCoils()) sequence.coils = on;
  return sequence;
}

PinSequence Motor::restore() const {
  PinSequence sequence = pins_.restore(
      [&](int line) { return power_.isEnabled() || isHeldByOthers(line); }, power_.isAsleep());
  if (hasCoils()) sequence.coils = power_.isEnabled();
  return sequence;
}

void Motor::noteEnable(bool wanted) {
  for (const EnableShare& enable : enables_) enable.shared->note(enable.number, wanted);
}

bool Motor::takeReleases() {
  bool released = false;
  for (EnableShare& enable : enables_) {
    released = released || enable.shared->releases() != enable.releases_seen;
    enable.releases_seen = enable.shared->releases();
  }
  return released;
}

void Motor::pinsRestored() {
  pins_doubtful_ = false;
  mode_failed_ = 0;
}

}  // namespace stepdriver::motor
