#include "named_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "config/least_time.h"
#include "gpio/chip_table.h"
#include "message_text.h"
#include "printable.h"
#include "pwm_line.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

using activity::Failure;
using activity::SharedCall;

// ---- one ----

NamedOutput::NamedOutput(const config::OutputConfig& config, std::size_t number, int line)
    : config_(config), number_(number), line_(line), wanted_{config.at_fault} {
  state_.name = config.name;
  written_.setting = wanted_;
  state_.on = wanted_.on;
  state_.value = wanted_.value();
}

void NamedOutput::set(const OutputSetting& setting, const SharedCall& call) {
  if (setting != wanted_) {
    refuseCalls(
        fmt::format("another command switches it {}", switchText(setting.on, setting.value())));
  }
  wanted_ = setting;
  state_.note.clear();
  if (call) calls_.push_back(call);
}

void NamedOutput::begin(const SharedCall& call) {
  wanted_ = {config_.initial};
  write_calls_.push_back(call);
}

void NamedOutput::retry(const SharedCall& call) {
  if (state_.error.empty()) return;
  gave_up_ = false;
  write_calls_.push_back(call);
}

void NamedOutput::await(const SharedCall& call) {
  if (job_) {
    write_calls_.push_back(call);
  } else if (!state_.error.empty()) {
    call->fail({Failure::Kind::kGpio, state_.error});
  }
}

std::string NamedOutput::poll(activity::Context& context, const std::string& why_safe) {
  const bool must_be_safe = !why_safe.empty();
  const bool was_safe = wanted_.on == config_.at_fault;
  std::string failure = adopt(context);
  if (const std::string own = endWrite(context); failure.empty()) failure = own;
  activity::MotionOutputs& paths = context.motion_outputs;
  is_taken_ = paths.isTaken(number_);
  state_.axis = paths.comparedAxis(number_);
  if (must_be_safe) {
    paths.end(context, number_);
    paths.takeWanted(number_);
    refuseCalls(why_safe);
    if (!was_safe) {
      state_.note =
          fmt::format("was switched {} for safety: {}", config_.at_fault ? "on" : "off", why_safe);
    }
    wanted_ = {config_.at_fault};
  } else if (is_taken_) {
    paths.note(number_, lineForMotions(why_safe));
    return failure;
  } else if (const std::optional<bool> left = paths.takeWanted(number_)) {
    set({*left}, {});
  } else if (mustGoOff(context.now)) {
    wanted_ = {};
    state_.note = tooLongText();
  }
  may_wait_ = !must_be_safe;
  if (job_ || (!certain_ && gave_up_)) return failure;
  if (certain_ && written_.setting == wanted_) {
    calls_.clear();
    write_calls_.clear();
  } else if (must_be_safe || context.now >= mayChange()) {
    write(context, must_be_safe);
  }
  paths.note(number_, lineForMotions(why_safe));
  return failure;
}

// What a path has made of the line since the last look.
std::string NamedOutput::adopt(activity::Context& context) {
  const pulse::OutputLineState& by_path = context.motion_outputs.state(number_);
  state_.compared = by_path.compared;
  state_.missed = by_path.missed;
  if (by_path.changes != std::exchange(changes_seen_, by_path.changes)) {
    // If it was written here at that time, nobody knows which write came last.
    if (job_) job_->doubtful = true;
    const pulse::Nanoseconds changed = by_path.written.changed;
    if (changed <= wrote_until_ && changed >= wrote_from_) certain_ = false;
    if (changed >= wrote_from_) {
      noteWritten(by_path.written);
      wanted_ = written_.setting;
      state_.note = by_path.too_long ? tooLongText() : "";
    }
  }
  if (by_path.failures == std::exchange(failures_seen_, by_path.failures)) return {};
  return failed(by_path.error, context);
}

activity::MotionOutputs::Line NamedOutput::lineForMotions(const std::string& why_safe) const {
  activity::MotionOutputs::Line line;
  if (!why_safe.empty()) {
    line.why_not = why_safe;
  } else if (!state_.error.empty()) {
    line.why_not = state_.error;
  } else if (job_ || written_.setting != wanted_) {
    line.why_not = "it is being switched";
  }
  line.written = written_;
  return line;
}

pulse::Nanoseconds NamedOutput::due() const {
  if (job_ || is_taken_ || !may_wait_ || (!certain_ && gave_up_)) return pulse::kNever;
  if (!certain_ || written_.setting != wanted_) return mayChange();
  return state_.on && config_.max_on_ns ? written_.on_since + *config_.max_on_ns : pulse::kNever;
}

std::string NamedOutput::tooLongText() const {
  return fmt::format("was switched off: it had been on for {} s, the most that max_on_s allows",
                     numberText(static_cast<double>(*config_.max_on_ns) / 1e9));
}

bool NamedOutput::mustGoOff(pulse::Nanoseconds now) const {
  return certain_ && state_.on && wanted_.on && config_.max_on_ns &&
         now >= written_.on_since + *config_.max_on_ns;
}

pulse::Nanoseconds NamedOutput::mayChange() const {
  if (!certain_ || !state_.changed || written_.setting.on == wanted_.on) return 0;
  return written_.switched + config::leastTime(config_, state_.on).ns;
}

void NamedOutput::write(activity::Context& context, bool safe) {
  job_ = Job{context.newJob(), wanted_, safe, context.now};
  context.out->pin_jobs.push_back({job_->id, line_, config_.level(wanted_.on), wanted_.part});
}

std::string NamedOutput::endWrite(activity::Context& context) {
  if (!job_ || !context.pin_done || context.pin_done->id != job_->id) return {};
  const Job job = *std::exchange(job_, std::nullopt);
  const std::vector<SharedCall> calls = std::exchange(write_calls_, {});
  if (const int error = context.pin_done->error; error != 0) {
    std::string text = failed(error, context);
    gave_up_ = job.safe;
    for (const SharedCall& call : calls) call->fail({Failure::Kind::kGpio, text});
    return text;
  }
  wrote_from_ = job.began;
  wrote_until_ = context.now;
  certain_ = !job.doubtful;
  gave_up_ = false;
  state_.error.clear();
  if (job.setting == written_.setting) return {};
  pulse::WrittenOutput written = written_;
  written.changed = context.now;
  if (job.setting.on != written.setting.on) {
    written.switched = context.now;
    if (job.setting.on) written.on_since = job.began;
  }
  written.setting = job.setting;
  noteWritten(written);
  return {};
}

void NamedOutput::noteWritten(const pulse::WrittenOutput& written) {
  written_ = written;
  state_.on = written.setting.on;
  state_.value = written.setting.value();
  state_.changed = written.changed;
}

std::string NamedOutput::failed(int error, activity::Context& context) {
  certain_ = false;
  gave_up_ = false;
  state_.error = failureText(error, context.lines);
  for (const SharedCall& call : std::exchange(calls_, {})) {
    call->fail({Failure::Kind::kGpio, state_.error});
  }
  return state_.error;
}

std::string NamedOutput::failureText(int error, const axis::LineNames& names) const {
  return fmt::format(
      "the line {} of the output {} can't be written: {}; check the cable and the supply of its "
      "chip",
      names.output(line_), config_.name, gpio::errorText(error));
}

void NamedOutput::refuseCalls(const std::string& why) {
  for (const SharedCall& call : std::exchange(calls_, {})) {
    call->fail({Failure::Kind::kRefused, fmt::format("the output {}: {}", config_.name, why)});
  }
}

// ---- all ----

NamedOutputs::NamedOutputs(const std::vector<config::OutputConfig>& outputs,
                           const std::vector<int>& lines) {
  for (std::size_t i = 0; i < outputs.size(); ++i) outputs_.emplace_back(outputs[i], i, lines[i]);
}

void NamedOutputs::begin(const SharedCall& call) {
  for (NamedOutput& output : outputs_) output.begin(call);
}

void NamedOutputs::set(const activity::Context& context, const std::string& name, bool on,
                       double value, const SharedCall& call) {
  const std::size_t number = numberOf(name);
  const std::string why = whyNoValue(on, value, pwmLineOf(config(number).line).has_value());
  if (!why.empty()) throw Refused(fmt::format("the output {}: {}", name, why));
  const bool is_free = !context.motion_outputs.isTaken(number) &&
                       context.motion_outputs.comparedAxis(number).empty();
  if (is_free) return outputs_[number].set(OutputSetting::of(on, value), call);
  throw Refused(
      fmt::format("the output {}: {} switches it", name, context.motion_outputs.holder(number)));
}

std::size_t NamedOutputs::numberOf(const std::string& name) const {
  const auto found = std::find_if(outputs_.begin(), outputs_.end(),
                                  [&](const NamedOutput& output) { return output.name() == name; });
  if (found != outputs_.end()) return static_cast<std::size_t>(found - outputs_.begin());
  if (outputs_.empty()) {
    throw Refused(fmt::format("there is no output {}: none is configured", printable(name)));
  }
  throw Refused(
      fmt::format("there is no output {} (outputs: {})", printable(name),
                  joinedText(outputs_, [](const NamedOutput& output) { return output.name(); })));
}

void NamedOutputs::stop(const activity::Context& context) {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const std::optional<bool>& at_stop = outputs_[i].config().at_stop;
    if (at_stop && !context.motion_outputs.isTaken(i)) outputs_[i].set({*at_stop}, {});
  }
}

void NamedOutputs::retry(const SharedCall& call) {
  for (NamedOutput& output : outputs_) output.retry(call);
}

void NamedOutputs::await(const SharedCall& call) {
  for (NamedOutput& output : outputs_) output.await(call);
}

std::string NamedOutputs::poll(activity::Context& context, const std::string& why_safe) {
  std::string failure;
  for (NamedOutput& output : outputs_) {
    const std::string own = output.poll(context, why_safe);
    if (failure.empty()) failure = own;
  }
  return failure;
}

std::string NamedOutputs::failureText(const pulse::LineFailure& failure,
                                      const axis::LineNames& names) const {
  const auto found = std::find_if(outputs_.begin(), outputs_.end(), [&](const NamedOutput& output) {
    return output.line() == failure.line;
  });
  return found != outputs_.end() ? found->failureText(failure.error, names) : "";
}

pulse::Nanoseconds NamedOutputs::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const NamedOutput& output : outputs_) due = std::min(due, output.due());
  return due;
}

bool NamedOutputs::areBeingWritten() const {
  return std::any_of(outputs_.begin(), outputs_.end(),
                     [](const NamedOutput& output) { return output.isBeingWritten(); });
}

std::vector<config::OutputConfig> NamedOutputs::configs() const {
  std::vector<config::OutputConfig> configs;
  for (const NamedOutput& output : outputs_) configs.push_back(output.config());
  return configs;
}

std::vector<OutputState> NamedOutputs::states() const {
  std::vector<OutputState> states;
  for (const NamedOutput& output : outputs_) states.push_back(output.state());
  return states;
}

}  // namespace stepdriver::machine
