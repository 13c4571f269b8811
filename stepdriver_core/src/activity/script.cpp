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
        if (context().mode.held && steps_.front()->manoeuvre() != nullptr) return;
        current_ = std::move(steps_.front());
        steps_.pop_front();
        current_->begin();
      }
      if (!current_->look()) return;
      current_.reset();
    }
  } catch (const Error& error) {
    fail(failureOf(error));
  }
}

void Script::fail(const Failure& failure) {
  if (call_) call_->fail(failure);
  call_.reset();
  for (Predecessor& left : takePredecessors()) Manoeuvre::conclude(context(), left);
  steps_.clear();
  current_.reset();
  finish();
}

void Script::onEnd(const Why& why, const Ack& call) {
  if (!ended_) ended_ = why;
  if (current_) current_->end(why, call);
  run();
}

Failure Script::notDone(const std::string& why) const {
  return {Failure::Kind::kRefused, axes().front()->name() + ": " + why};
}

void Script::onAbandon(const Why& why) {
  if (call_) call_->fail(notDone(why.text));
  call_.reset();
}

// ---- its motion ----

bool Script::canHandOver() const { return motion() != nullptr; }

const Manoeuvre* Script::motion() const { return current_ ? current_->manoeuvre() : nullptr; }

std::vector<Predecessor> Script::handOver(const std::string& by) {
  std::vector<Predecessor> left = current_->manoeuvre()->handOver();
  fail(notDone(by));
  return left;
}

void Script::hold(const Ack& call) {
  if (Manoeuvre* manoeuvre = current_ ? current_->manoeuvre() : nullptr) manoeuvre->hold(call);
}

void Script::refuseUnlessResumable() const {
  if (motion() != nullptr) motion()->refuseUnlessResumable();
}

void Script::resume(const Ack& call) {
  if (Manoeuvre* manoeuvre = current_ ? current_->manoeuvre() : nullptr) manoeuvre->resume(call);
}

void Script::speedChanged(const Ack& call) {
  if (Manoeuvre* manoeuvre = current_ ? current_->manoeuvre() : nullptr) manoeuvre->replan(call);
}

void Script::extend(const Extension& extension, const Ack& call) {
  Manoeuvre* manoeuvre = current_ ? current_->manoeuvre() : nullptr;
  if (manoeuvre == nullptr) return Activity::extend(extension, call);
  manoeuvre->extend(extension, call);
  run();
}

pulse::Nanoseconds Script::due() const { return current_ ? current_->due() : pulse::kNever; }

}  // namespace stepdriver::activity
