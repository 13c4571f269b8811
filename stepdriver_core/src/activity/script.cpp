#include "script.h"

#include <iterator>

#include "stepdriver_core/error.h"

namespace stepdriver::activity {

void Script::onBegin(std::vector<Predecessor> predecessors) {
  predecessors_ = std::move(predecessors);
  try {
    insert(plan());
  } catch (const Error& error) {
    return fail(failureOf(error));
  }
  run();
}

void Script::insert(Steps steps) {
  steps_.insert(steps_.begin(), std::make_move_iterator(steps.begin()),
                std::make_move_iterator(steps.end()));
}

void Script::run() {
  try {
    for (;;) {
      if (current_ == nullptr) {
        if (steps_.empty()) return finish();
        if (ended_) {
          return fail(notDone(ended_->text));
        }
        if (context().mode.held && steps_.front()->execution() != nullptr) return;
        current_ = std::move(steps_.front());
        steps_.pop_front();
        current_->begin();
      }
      if (!current_->poll()) return;
      current_.reset();
    }
  } catch (const Error& error) {
    fail(failureOf(error));
  }
}

void Script::fail(const Failure& failure) {
  if (call_) call_->fail(failure);
  call_.reset();
  for (Predecessor& left : takePredecessors()) MotionExecution::conclude(context(), left);
  steps_.clear();
  current_.reset();
  finish();
}

void Script::onEnd(const EarlyEnd& why, const SharedCall& call) {
  if (!ended_) ended_ = why;
  if (current_) current_->end(why, call);
  run();
}

Failure Script::notDone(const std::string& why) const {
  return {Failure::Kind::kRefused, axes().front()->name() + ": " + why};
}

void Script::onAbandon(const EarlyEnd& why) {
  if (call_) call_->fail(notDone(why.text));
  call_.reset();
}

// ---- its motion ----

bool Script::canHandOver() const { return motion() != nullptr; }

const MotionExecution* Script::motion() const { return current_ ? current_->execution() : nullptr; }

std::vector<Predecessor> Script::handOver(const std::string& by) {
  std::vector<Predecessor> left = current_->execution()->handOver();
  fail(notDone(by));
  return left;
}

void Script::hold(const SharedCall& call) {
  if (MotionExecution* execution = current_ ? current_->execution() : nullptr)
    execution->hold(call);
}

void Script::refuseUnlessResumable() const {
  if (motion() != nullptr) motion()->refuseUnlessResumable();
}

void Script::resume(const SharedCall& call) {
  if (MotionExecution* execution = current_ ? current_->execution() : nullptr)
    execution->resume(call);
}

void Script::speedChanged(const SharedCall& call) {
  if (MotionExecution* execution = current_ ? current_->execution() : nullptr)
    execution->replan(call);
}

void Script::extend(const Extension& extension, const SharedCall& call) {
  MotionExecution* execution = current_ ? current_->execution() : nullptr;
  if (execution == nullptr) return Activity::extend(extension, call);
  execution->extend(extension, call);
  run();
}

pulse::Nanoseconds Script::due() const { return current_ ? current_->due() : pulse::kNever; }

}  // namespace stepdriver::activity
