#include "named_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "message_text.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/chip_table.h"
#include "stepdriver_core/printable.h"

namespace stepdriver::machine {

using activity::Failure;
using activity::SharedCall;

// ---- one ----

NamedOutput::NamedOutput(const config::OutputConfig& config, int line)
    : config_(config), line_(line), wanted_(config.at_fault) {
  state_.name = config.name;
  state_.on = config.at_fault;
}

void NamedOutput::set(bool on, const SharedCall& call) {
  if (on != wanted_) refuseCalls(fmt::format("another command switches it {}", on ? "on" : "off"));
  wanted_ = on;
  state_.note.clear();
  if (call) calls_.push_back(call);
}

void NamedOutput::begin(const SharedCall& call) {
  wanted_ = config_.initial;
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
  std::string failure = endWrite(context);
  if (must_be_safe) {
    refuseCalls(why_safe);
    wanted_ = config_.at_fault;
  } else if (mustGoOff(context.now)) {
    wanted_ = false;
    state_.note =
        fmt::format("was switched off: it had been on for {} s, the most that max_on_s allows",
                    numberText(static_cast<double>(*config_.max_on_ns) / 1e9));
  }
  may_wait_ = !must_be_safe;
  if (job_ || (!certain_ && gave_up_)) return failure;
  if (certain_ && state_.on == wanted_) {
    calls_.clear();
    write_calls_.clear();
  } else if (must_be_safe || context.now >= mayChange()) {
    write(context, must_be_safe);
  }
  return failure;
}

pulse::Nanoseconds NamedOutput::due() const {
  if (job_ || !may_wait_ || (!certain_ && gave_up_)) return pulse::kNever;
  if (!certain_ || state_.on != wanted_) return mayChange();
  return state_.on && config_.max_on_ns ? on_since_ + *config_.max_on_ns : pulse::kNever;
}

bool NamedOutput::mustGoOff(pulse::Nanoseconds now) const {
  return certain_ && state_.on && wanted_ && config_.max_on_ns &&
         now >= on_since_ + *config_.max_on_ns;
}

pulse::Nanoseconds NamedOutput::mayChange() const {
  if (!certain_ || !state_.changed) return 0;
  return *state_.changed + (state_.on ? config_.min_on_ns : config_.min_off_ns);
}

void NamedOutput::write(activity::Context& context, bool safe) {
  job_ = Job{context.newJob(), wanted_, safe, context.now};
  context.out->pin_jobs.push_back({job_->id, line_, config_.level(wanted_)});
}

std::string NamedOutput::endWrite(activity::Context& context) {
  if (!job_ || !context.pin_done || context.pin_done->id != job_->id) return {};
  const Job job = *std::exchange(job_, std::nullopt);
  const std::vector<SharedCall> calls = std::exchange(write_calls_, {});
  if (const int error = context.pin_done->error; error != 0) {
    certain_ = false;
    gave_up_ = job.safe;
    state_.error = fmt::format(
        "the line {} of the output {} can't be written: {}; check the cable and the supply of its "
        "chip",
        context.lines.output(line_), config_.name, gpio::errorText(error));
    for (const std::vector<SharedCall>& waiting : {calls, std::exchange(calls_, {})}) {
      for (const SharedCall& call : waiting) call->fail({Failure::Kind::kGpio, state_.error});
    }
    return state_.error;
  }
  certain_ = true;
  gave_up_ = false;
  state_.error.clear();
  if (job.on == state_.on) return {};
  state_.on = job.on;
  on_since_ = job.began;
  state_.changed = context.now;
  return {};
}

void NamedOutput::refuseCalls(const std::string& why) {
  for (const SharedCall& call : std::exchange(calls_, {})) {
    call->fail({Failure::Kind::kRefused, fmt::format("the output {}: {}", config_.name, why)});
  }
}

// ---- all ----

NamedOutputs::NamedOutputs(const std::vector<config::OutputConfig>& outputs,
                           const std::vector<int>& lines) {
  for (std::size_t i = 0; i < outputs.size(); ++i) outputs_.emplace_back(outputs[i], lines[i]);
}

void NamedOutputs::begin(const SharedCall& call) {
  for (NamedOutput& output : outputs_) output.begin(call);
}

void NamedOutputs::set(const std::string& name, bool on, const SharedCall& call) {
  const auto found = std::find_if(outputs_.begin(), outputs_.end(),
                                  [&](const NamedOutput& output) { return output.name() == name; });
  if (found != outputs_.end()) return found->set(on, call);
  if (outputs_.empty()) {
    throw Refused(fmt::format("there is no output {}: none is configured", printable(name)));
  }
  throw Refused(
      fmt::format("there is no output {} (outputs: {})", printable(name),
                  joinedText(outputs_, [](const NamedOutput& output) { return output.name(); })));
}

void NamedOutputs::stop() {
  for (NamedOutput& output : outputs_) {
    if (output.config().at_stop) output.set(*output.config().at_stop, {});
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

pulse::Nanoseconds NamedOutputs::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const NamedOutput& output : outputs_) due = std::min(due, output.due());
  return due;
}

bool NamedOutputs::areBeingWritten() const {
  return std::any_of(outputs_.begin(), outputs_.end(),
                     [](const NamedOutput& output) { return output.isBeingWritten(); });
}

std::vector<OutputState> NamedOutputs::states() const {
  std::vector<OutputState> states;
  for (const NamedOutput& output : outputs_) states.push_back(output.state());
  return states;
}

}  // namespace stepdriver::machine
