#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::activity {

/// A client's call, by the number that the shell has assigned.
using CallId = std::uint64_t;

/// Why a call failed. It becomes an exception in the thread of its caller.
struct Failure {
  enum class Kind {
    kRefused,
    kGpio,
    kOutdated,  ///< the facts that it was prepared from have changed: it may be prepared again
    kOther,
  };
  Kind kind = Kind::kRefused;
  std::string text;
};

/// An accepted homing, and the outcome that receives its result.
struct AcceptedHoming {
  std::vector<std::uint64_t> ids;
  std::vector<std::shared_ptr<const axis::Outcome<axis::HomingResult>>> outcomes;
};

/// Why each part of a call was refused or failed; empty if it was carried out.
using Refusals = std::vector<std::string>;

/// The answer to a call.
struct Reply {
  std::optional<Failure> failure;
  std::variant<std::monostate, std::vector<axis::Move>, axis::MovePlan, AcceptedHoming, Refusals>
      value;
};

/// Receives answers.
class AnswerSink {
 public:
  virtual ~AnswerSink() = default;
  virtual void answer(CallId call, Reply reply) = 0;
};

/// A call that is not yet answered. It is answered when its last holder releases it, so that each
/// call gets exactly one answer in any case.
class PendingCall {
 public:
  PendingCall(AnswerSink& sink, CallId id) : sink_(sink), id_(id) {}
  ~PendingCall() { sink_.answer(id_, std::move(reply_)); }
  PendingCall(const PendingCall&) = delete;
  PendingCall& operator=(const PendingCall&) = delete;

  /// Several failures are reported in one sentence each.
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

/// Shared by everything that contributes to the answer; may be empty if nobody waits for it.
using SharedCall = std::shared_ptr<PendingCall>;

/// A call in several parts, each of which may be refused by itself. It is answered with its
/// Refusals when all parts are answered.
class PartedCall : public AnswerSink {
 public:
  PartedCall(SharedCall whole, std::size_t parts) : whole_(std::move(whole)), refusals_(parts) {}
  ~PartedCall() override { whole_->succeed(std::move(refusals_)); }
  PartedCall(const PartedCall&) = delete;
  PartedCall& operator=(const PartedCall&) = delete;

  /// @return for each part its call.
  static std::vector<SharedCall> divide(SharedCall whole, std::size_t parts) {
    const auto parted = std::make_shared<PartedCall>(std::move(whole), parts);
    std::vector<SharedCall> calls;
    for (std::size_t i = 0; i < parts; ++i) {
      const auto part = std::make_shared<Part>(parted, i);
      calls.emplace_back(part, &part->call);
    }
    return calls;
  }

  void answer(CallId part, Reply reply) override {
    if (reply.failure) refusals_.at(part) = std::move(reply.failure->text);
  }

 private:
  struct Part {
    Part(std::shared_ptr<PartedCall> parted, CallId number)
        : of(std::move(parted)), call(*of, number) {}

    std::shared_ptr<PartedCall> of;
    PendingCall call;  // answers `of` when it ends
  };

  SharedCall whole_;
  Refusals refusals_;
};

}  // namespace stepdriver::activity
