#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::activity {

/// A call of a client, by the number that the shell has given it.
using CallId = std::uint64_t;

/// Why a call had no success. It becomes an exception in the thread of its caller.
struct Failure {
  enum class Kind {
    kRefused,
    kGpio,
    kOutdated,  ///< what it was prepared from has changed meanwhile: it may be prepared again
    kOther,
  };
  Kind kind = Kind::kRefused;
  std::string text;
};

/// A homing that was accepted, and where its result appears.
struct AcceptedHoming {
  std::vector<std::uint64_t> ids;
  std::vector<std::shared_ptr<const axis::Outcome<axis::HomingResult>>> outcomes;
};

/// What a call is answered with.
struct Reply {
  std::optional<Failure> failure;
  std::variant<std::monostate, std::vector<axis::Move>, axis::MovePlan, AcceptedHoming> value;
};

/// Where answers go.
class AnswerSink {
 public:
  virtual ~AnswerSink() = default;
  virtual void answer(CallId call, Reply reply) = 0;
};

/// A call that is not yet answered. It is answered when the last who holds it lets go of it: each
/// call gets exactly one answer, whatever becomes of those who work on it.
class PendingCall {
 public:
  PendingCall(AnswerSink& sink, CallId id) : sink_(sink), id_(id) {}
  ~PendingCall() { sink_.answer(id_, std::move(reply_)); }
  PendingCall(const PendingCall&) = delete;
  PendingCall& operator=(const PendingCall&) = delete;

  /// Several failures are told in one sentence each.
  void fail(Failure failure) {
    if (!reply_.failure) {
      reply_.failure = std::move(failure);
    } else {
      reply_.failure->text += "; " + failure.text;
      if (reply_.failure->kind != failure.kind) reply_.failure->kind = Failure::Kind::kOther;
    }
  }
  template <typename Value>
  void succeed(Value value) {
    reply_.value = std::move(value);
  }

 private:
  AnswerSink& sink_;
  const CallId id_;
  Reply reply_;
};

/// Shared by all who have a part in the answer; may be empty if nobody waits for it.
using Ack = std::shared_ptr<PendingCall>;

}  // namespace stepdriver::activity
