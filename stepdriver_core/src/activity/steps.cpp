#include "steps.h"

#include <algorithm>

#include "stepdriver_core/error.h"

namespace stepdriver::activity {

// ---- pins ----

void PinsStep::post(pulse::Command::Kind kind) {
  pulse::Command command;
  command.kind = kind;
  command.channel = axis_.motor.channel();
  command.serial = serial_ = axis_.motor.nextSerial();
  if (kind == pulse::Command::Kind::kRelease) {
    command.ready = due_;
    command.scale = writes_.scale;
    if (const auto on = writes_.sequence.coils) {
      command.coils = axis_.motor.coilCurrent(*on);
      if (*on) command.ready += axis_.config.timing().enable_ns;
    }
  }
  context_.out->commands.push_back(command);
}

bool PinsStep::sharersMove() const {
  const auto& sharers = axis_.sharers();
  return std::any_of(sharers.begin(), sharers.end(),
                     [](const axis::AxisModel* sharer) { return sharer->moving(); });
}

void PinsStep::begin() {
  if (sharersMove()) return;
  writes_ = build_();
  post(pulse::Command::Kind::kReserve);
  phase_ = Phase::kReserving;
}

bool PinsStep::poll() {
  const pulse::ChannelState& state = axis_.motor.state();
  if (phase_ == Phase::kAwaitingRest) {
    begin();
    return false;
  }
  if (phase_ == Phase::kReserving) {
    if (state.taken < serial_) return false;
    if (state.accepted != serial_) axis_.refuse("it moves");
    const driver::Timing timing = axis_.config.timing();
    const pulse::Nanoseconds held = state.rose + std::max(timing.mode_hold_ns, timing.step_high_ns);
    due_ = state.pulses != 0 ? std::max(context_.now, held) : context_.now;
    phase_ = Phase::kWaiting;
  }
  if (phase_ == Phase::kWriting) {
    if (!context_.pin_done || context_.pin_done->id != job_) return false;
    if (context_.pin_done->error != 0) fail(context_.pin_done->error);
    const motor::PinSequence::Write& written = writes_.sequence.writes[next_ - 1];
    axis_.motor.brake().noteWritten(written.line, written.level, context_.now);
    due_ = context_.now + written.then_wait;
    phase_ = Phase::kWaiting;
  }
  if (phase_ == Phase::kAccessing) {
    if (!context_.register_done || context_.register_done->id != job_) return false;
    const std::string why = writes_.take(*context_.register_done);
    axis_.motor.noteChips();
    if (!why.empty()) failRegisters(why);
    writes_.registers.reset();
    due_ = context_.now + axis_.config.timing().mode_setup_ns;
    phase_ = Phase::kWaiting;
  }
  if (phase_ == Phase::kWaiting) {
    if (next_ < writes_.sequence.size) {
      writeNext();
      return false;
    }
    if (writes_.registers) {
      beginRegisters();
      return false;
    }
    post(pulse::Command::Kind::kRelease);
    phase_ = Phase::kReleasing;
    return false;
  }
  if (state.taken < serial_) return false;
  axis_.rest_since = context_.now;
  if (writes_.then) writes_.then();
  return true;
}

void PinsStep::writeNext() {
  if (context_.now < due_) return;
  const motor::PinSequence::Write& write = writes_.sequence.writes[next_++];
  job_ = context_.newJob();
  context_.out->pin_jobs.push_back({job_, write.line, write.level});
  phase_ = Phase::kWriting;
}

void PinsStep::beginRegisters() {
  if (context_.now < due_) return;
  job_ = context_.newJob();
  writes_.registers->id = job_;
  context_.out->register_jobs.push_back(*writes_.registers);
  phase_ = Phase::kAccessing;
}

void PinsStep::failRegisters(const std::string& why) {
  const std::string text = axis_.chipText(0) + " " + why;
  axis_.fault.latch(text, axis_.motor.tmcAt(0)->remedy());
  axis_.distrust();
  axis_.rest_since = context_.now;
  writes_.scale.reset();
  due_ = context_.now;
  post(pulse::Command::Kind::kRelease);
  throw GpioError(axis_.name() + ": " + text);
}

void PinsStep::fail(int error) {
  const motor::PinSequence::Write& write = writes_.sequence.writes[next_ - 1];
  const pulse::LineFailure failure{error, write.line, false};
  const std::string text = axis_.failureText(failure);
  axis_.fault.latch(text, "then call recover");
  axis_.distrust();
  axis_.motor.doubtPins();
  axis_.motor.brake().noteFailed(write.line, write.level);
  axis_.rest_since = context_.now;
  if (writes_.failed) writes_.failed();
  writes_.scale.reset();
  writes_.sequence.coils.reset();
  due_ = context_.now;
  post(pulse::Command::Kind::kRelease);
  throw GpioError(axis_.name() + ": " + text);
}

std::unique_ptr<Step> pinsStep(Context& context, axis::AxisModel& axis,
                               const motor::PinSequence& sequence, std::function<void()> then) {
  return std::make_unique<PinsStep>(context, axis, [sequence, then = std::move(then)] {
    PinsStep::Writes writes;
    writes.sequence = sequence;
    writes.then = then;
    return writes;
  });
}

std::unique_ptr<Step> enableStep(Context& context, axis::AxisModel& axis, bool on,
                                 std::function<void()> then) {
  return std::make_unique<PinsStep>(context, axis, [&context, &axis, on, then = std::move(then)] {
    PinsStep::Writes writes;
    writes.sequence = axis.motor.enable(on);
    axis.motor.noteEnable(on);
    for (const auto& other : context.axes) {
      if (other->motor.takeReleases()) other->noteDisabled();
    }
    writes.then = then;
    writes.failed = [&axis, on] { axis.motor.noteEnable(!on); };
    return writes;
  });
}

// ---- registers ----

void SetUpChipsStep::begin() {
  for (std::size_t i = 0; i < axis_.motor.chips(); ++i) {
    const motor::TmcChip* chip = axis_.motor.tmcAt(i);
    if (chip == nullptr) continue;
    const bool is_ready = which_ != Which::kAll && chip->isSetUp();
    if (!is_ready || which_ == Which::kFaulty) post({i, is_ready});
  }
}

void SetUpChipsStep::post(const Open& open) {
  motor::TmcChip& chip = *axis_.motor.tmcAt(open.motor);
  bus::RegisterJob job =
      open.asks ? chip.poll()
                : chip.setUp(axis_.motor.microsteps(), context_.addressesOn(chip.config().port));
  job.id = context_.newJob();
  open_[job.id] = open;
  if (!open.asks) chip.forget();
  context_.out->register_jobs.push_back(std::move(job));
}

bool SetUpChipsStep::poll() {
  const auto& done = context_.register_done;
  if (const auto found = done ? open_.find(done->id) : open_.end(); found != open_.end()) {
    const Open open = found->second;
    open_.erase(found);
    take(open, *done);
  }
  if (!open_.empty()) return false;
  if (!fault_.empty()) failed_(fault_, remedy_);
  return true;
}

void SetUpChipsStep::take(const Open& open, const bus::RegisterDone& done) {
  motor::TmcChip& chip = *axis_.motor.tmcAt(open.motor);
  const std::string why = open.asks ? chip.takePoll(done) : chip.takeSetUp(done);
  axis_.motor.noteChips();
  if (open.asks) {
    if (why.empty()) return;
    axis_.distrust();
    post({open.motor, false});
  } else if (why.empty()) {
    axis_.motor.alignTranslator(open.motor);
  } else if (fault_.empty()) {
    fault_ = axis_.chipText(open.motor) + " " + why;
    remedy_ = chip.remedy();
  }
}

Steps wakeSteps(Context& context, axis::AxisModel& axis) {
  Steps steps;
  if (!axis.mustWake()) return steps;
  if (!axis.motor.power().isIdle()) {
    steps.push_back(std::make_unique<ReleaseBrakeStep>(context, axis));
    return steps;
  }
  const auto awake = [&axis] { axis.motor.power().setIdle(false); };
  if (axis.config.idle_action == config::IdleAction::kLowerCurrent) {
    // The current of a motion is another one, so it needn't wait.
    steps.push_back(std::make_unique<RunStep>(awake));
    if (axis.motor.brake().isWired()) {
      steps.push_back(std::make_unique<ReleaseBrakeStep>(context, axis));
    }
    return steps;
  }
  if (axis.config.idle_action == config::IdleAction::kSleep) {
    steps.push_back(pinsStep(context, axis, axis.motor.pins().sleep(false), awake));
  } else {
    steps.push_back(enableStep(context, axis, true, awake));
  }
  return braked(context, axis, std::move(steps));
}

// ---- the motor power ----

void refuseIfStopped(const Context& context, const axis::AxisModel& axis) {
  axis.refuseUnlessOpen();
  if (context.stops_asked != context.stops_cleared) {
    axis.refuse("an emergency stop has come meanwhile");
  }
}

void refuseUnlessCurrentStays(const Context& context, const axis::AxisModel& axis) {
  axis.refuseUnlessOpen();
  if (axis.fault) axis.refuse("at fault: " + axis.fault.what() + "; call recover first");
  refuseIfStopped(context, axis);
}

void PowerStep::begin() {
  refuseIfStopped(context_, axis_);
  context_.motor_power.switchOn();
}

bool PowerStep::poll() {
  const MotorPower& power = context_.motor_power;
  if (power.isWanted()) return power.isThere();
  refuseIfStopped(context_, axis_);
  if (power.failure().empty()) axis_.refuse("the motor power was switched off meanwhile");
  throw GpioError(axis_.name() + ": " + power.failure());
}

Steps powerSteps(Context& context, axis::AxisModel& axis) {
  Steps steps;
  if (context.motor_power.isWired()) steps.push_back(std::make_unique<PowerStep>(context, axis));
  return steps;
}

// ---- the brake ----

void EngageBrakeStep::begin() {
  if (axis_.motor.brake().isEngaged()) return;
  writing_ = pinsStep(context_, axis_, axis_.motor.brake().engage());
  writing_->begin();
}

bool EngageBrakeStep::poll() {
  if (writing_ && !writing_->poll()) return false;
  writing_.reset();
  return context_.now >= axis_.motor.brake().settles();
}

pulse::Nanoseconds EngageBrakeStep::due() const {
  return writing_ ? writing_->due() : axis_.motor.brake().settles();
}

bool ReleaseBrakeStep::poll() {
  if (writing_ && !writing_->poll()) return false;
  writing_.reset();
  if (!axis_.motorHolds()) return true;
  const motor::Brake& brake = axis_.motor.brake();
  if (brake.isReleased()) return context_.now >= brake.settles();
  if (context_.now < axis_.motor.state().ready) return false;
  writing_ = pinsStep(context_, axis_, brake.release());
  writing_->begin();
  return false;
}

pulse::Nanoseconds ReleaseBrakeStep::due() const {
  if (writing_) return writing_->due();
  const motor::Brake& brake = axis_.motor.brake();
  return brake.isReleased() ? brake.settles() : axis_.motor.state().ready;
}

Steps engageSteps(Context& context, axis::AxisModel& axis) {
  Steps steps;
  if (axis.motor.brake().isWired()) {
    steps.push_back(std::make_unique<EngageBrakeStep>(context, axis));
  }
  return steps;
}

Steps braked(Context& context, axis::AxisModel& axis, Steps steps) {
  if (!axis.motor.brake().isWired() || steps.empty()) return steps;
  Steps safe = engageSteps(context, axis);
  append(safe, std::move(steps));
  safe.push_back(std::make_unique<ReleaseBrakeStep>(context, axis));
  return safe;
}

// ---- motions ----

void FollowStep::begin() {
  if (moves_.empty()) prepare();
  SharedCall call = call_();
  if (call) call->succeed(moves_);
  execution_.begin(predecessors_(), std::move(call));
}

}  // namespace stepdriver::activity
