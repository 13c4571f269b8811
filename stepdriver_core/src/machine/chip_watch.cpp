#include "chip_watch.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>

#include "nanoseconds.h"

namespace stepdriver::machine {
namespace {

// A fault of a chip with a serial port is known within this time, and that of the wire: a silent
// chip takes a tenth of a second for its three tries, and up to four share a port.
constexpr pulse::Nanoseconds kPollPeriod = 250'000'000;
constexpr pulse::Nanoseconds kAuditPeriod = 1'000'000'000;
// From a sample of the load in motion to the next one: 20 a second, or less on a slow wire, of
// which a chip's samples take at most a quarter.
constexpr pulse::Nanoseconds kSamplePeriod = 50'000'000;
constexpr pulse::Nanoseconds kPauseAfterSample = 3;  // times as long as the sample took

}  // namespace

ChipWatch::ChipWatch(activity::Context& context, IsHoming is_homing, Fail fail)
    : context_(context), is_homing_(std::move(is_homing)), fail_(std::move(fail)) {}

std::uint64_t ChipWatch::order(bus::RegisterJob job) {
  const std::uint64_t id = job.id = context_.newJob();
  context_.out->register_jobs.push_back(std::move(job));
  return id;
}

bool ChipWatch::answers(const motor::TmcChip& chip) const {
  return chip.isSetUp() && context_.mode.powered && context_.mode.closed.empty();
}

// ---- when ----

pulse::Nanoseconds ChipWatch::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const auto& axis : context_.axes) {
    for (std::size_t i = 0; i < axis->motor.chips(); ++i) {
      const motor::TmcChip* chip = axis->motor.tmcAt(i);
      if (chip != nullptr) due = std::min({due, pollDue(*chip), sampleDue(*axis, *chip)});
    }
  }
  return due;
}

pulse::Nanoseconds ChipWatch::pollDue(const motor::TmcChip& chip) const {
  return answers(chip) && chip.polling == 0 ? chip.next_poll : pulse::kNever;
}

// A homing to a stall reads the load itself.
pulse::Nanoseconds ChipWatch::sampleDue(const axis::AxisModel& axis,
                                        const motor::TmcChip& chip) const {
  const bool samples = answers(chip) && chip.measuresLoad() && axis.moving() &&
                       !chip.isPreparedForStall() && chip.sampling == 0;
  return samples ? chip.next_sample : pulse::kNever;
}

// ---- what is asked and written ----

void ChipWatch::supervise(axis::AxisModel& axis) {
  const auto moves = [](const axis::AxisModel* any) { return any->moving(); };
  const bool rests = !axis.fault && !axis.moving() &&
                     std::none_of(axis.sharers().begin(), axis.sharers().end(), moves);
  for (std::size_t i = 0; i < axis.motor.chips(); ++i) {
    motor::TmcChip* chip = axis.motor.tmcAt(i);
    if (chip == nullptr) continue;
    if (axis.fault) chip->audit().end();
    if (!rests) chip->resting_count.reset();
    endStall(axis, *chip);
    sampleLoad(axis, *chip);
    setIdleCurrent(axis, *chip);
    poll(axis, i, rests);
  }
}

void ChipWatch::poll(axis::AxisModel& axis, std::size_t motor, bool rests) {
  motor::TmcChip& chip = *axis.motor.tmcAt(motor);
  if (context_.now < pollDue(chip)) return;
  const bool audits = rests && context_.now >= chip.next_audit;
  if (audits) chip.resting_count = axis.motor.countOf(motor);
  chip.polling = order(chip.poll(audits));
}

void ChipWatch::sampleLoad(const axis::AxisModel& axis, motor::TmcChip& chip) {
  if (context_.now < sampleDue(axis, chip)) return;
  chip.sampled_since = context_.now;
  chip.sampling = order(chip.sampleLoad());
}

void ChipWatch::setIdleCurrent(const axis::AxisModel& axis, motor::TmcChip& chip) {
  const bool idle = axis.motor.power().isIdle() && chip.config().idle_current;
  if (idle == chip.isIdle() || chip.setting_idle != 0 || !answers(chip)) return;
  if (chip.isPreparedForStall()) return;
  chip.setting_idle = order(chip.setIdle(idle));
}

// Whatever has ended a homing to a stall: its registers are for nothing else.
void ChipWatch::endStall(const axis::AxisModel& axis, motor::TmcChip& chip) {
  if (!chip.isPreparedForStall() || chip.ending_stall != 0 || !chip.isSetUp()) return;
  if (is_homing_(axis)) return;
  chip.ending_stall = order(chip.endStall());
}

void ChipWatch::askForCause(axis::AxisModel& axis, std::size_t motor) {
  motor::TmcChip* chip = axis.registersAt(motor);
  if (chip == nullptr) return;
  chip->asks_for_cause = true;
  chip->polling = 0;  // one under way may have been answered before that
  chip->next_poll = context_.now;
}

// ---- what they answer ----

void ChipWatch::take(const bus::RegisterDone& done) {
  for (const auto& axis : context_.axes) {
    for (std::size_t i = 0; i < axis->motor.chips(); ++i) {
      motor::TmcChip* chip = axis->motor.tmcAt(i);
      if (chip == nullptr) continue;
      if (chip->polling == done.id) return takePoll(*axis, i, done);
      if (chip->sampling == done.id) return takeSample(*axis, i, done);
      const bool sets_idle = chip->setting_idle == done.id;
      if (!sets_idle && chip->ending_stall != done.id) continue;
      const std::string why = sets_idle ? chip->takeIdle(done) : chip->takeEndOfStall(done);
      axis->motor.noteChips();
      if (!why.empty()) fail(*axis, i, why);
      return;
    }
  }
}

void ChipWatch::takePoll(axis::AxisModel& axis, std::size_t motor, const bus::RegisterDone& done) {
  motor::TmcChip& chip = *axis.motor.tmcAt(motor);
  chip.polling = 0;
  chip.next_poll = context_.now + kPollPeriod;
  // Its supply was switched off meanwhile, or its registers are being written again.
  if (!chip.isSetUp() || !context_.mode.powered) return;
  std::string fault = chip.takePoll(done);
  axis.motor.noteChips();
  if (std::exchange(chip.asks_for_cause, false)) nameCause(axis, motor, fault);
  // Without a change meanwhile: of its mode, or by a step that was still on its way.
  const auto count = std::exchange(chip.resting_count, {});
  if (fault.empty() && count == axis.motor.countOf(motor)) {
    chip.next_audit = context_.now + kAuditPeriod;
    fault = chip.audited(*count, axis.motor.microsteps());
  }
  if (!fault.empty()) fail(axis, motor, fault);
}

void ChipWatch::takeSample(axis::AxisModel& axis, std::size_t motor,
                           const bus::RegisterDone& done) {
  motor::TmcChip& chip = *axis.motor.tmcAt(motor);
  const pulse::Nanoseconds took = context_.now - chip.sampled_since;
  chip.next_sample = context_.now + std::max(kSamplePeriod, kPauseAfterSample * took);
  const motion::MotionState planned = axis.motor.stateAt(context_.motionNow());
  const auto slack = static_cast<double>(axis.motor.state().slack);
  const std::string fault = chip.takeSample(done, axis.positionOf(planned.position.value() - slack),
                                            planned.velocity / axis.stepsPerUnit());
  axis.motor.noteChips();
  if (!fault.empty() && axis.moving()) fail(axis, motor, fault);
}

std::string ChipWatch::takeSetting(axis::AxisModel& axis, std::size_t motor,
                                   const bus::RegisterDone& done) {
  motor::TmcChip& chip = *axis.motor.tmcAt(motor);
  const bool was_set_up = chip.isSetUp();
  std::string why = chip.takeSetting(done);
  axis.motor.noteChips();
  if (!why.empty() && was_set_up) fail(axis, motor, why);
  return why;
}

// The fault output says that something is wrong; the registers say what.
void ChipWatch::nameCause(axis::AxisModel& axis, std::size_t motor, std::string fault) {
  motor::TmcChip& chip = *axis.motor.tmcAt(motor);
  if (axis.fault.remedy() != kChipRemedy) return;
  if (fault.empty()) fault = chip.stallFault();
  if (!fault.empty()) axis.fault.latch(axis.chipText(motor) + " " + fault, chip.remedy());
}

void ChipWatch::fail(axis::AxisModel& axis, std::size_t motor, const std::string& fault) {
  fail_(axis, axis.chipText(motor) + " " + fault, axis.motor.tmcAt(motor)->remedy());
}

}  // namespace stepdriver::machine
