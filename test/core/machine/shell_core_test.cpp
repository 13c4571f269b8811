#include "machine/shell_core.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "machine/wiring.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "support/bench.h"

namespace stepdriver::machine {
namespace {

/// One axis on the rig. Each event is handled when the test says so; slow lines are written at
/// once.
class ByHand : public ShellCore::Host, public pulse::NewsListener {
 public:
  ByHand() {
    engine_.listen(*this);
    answerOf(BringUp{});
    answerOf(SetPosition{0, 0.0});
  }

  ShellCore& core() { return core_; }
  void pressMaxSwitch() {
    sim::RigFaults faults;
    faults.max_stuck = true;
    rig_.setFaults("x", faults);
  }

  activity::CallId post(Request request) {
    EXPECT_EQ(core_.post(++calls_, std::move(request)), "");
    return calls_;
  }
  // Handles all that there is to do now.
  void settle() {
    bool any = true;
    while (any) {
      any = core_.takeNews() || core_.takeRequest() || core_.takeTime();
      for (; !written_.empty(); written_.erase(written_.begin())) core_.handle(written_.front());
      engine_due_ = engine_.serve();
    }
  }
  activity::Reply answerOf(Request request) {
    const activity::CallId call = post(std::move(request));
    for (settle(); answers_.count(call) == 0; settle()) {
      clock_.waitUntil(std::min(core_.due(), engine_due_));
    }
    return answers_.at(call);
  }
  const activity::Reply& answer(activity::CallId call) const { return answers_.at(call); }
  /// The engine says that the motion has ended, and nothing about a fault.
  void endMotion(pulse::EndReason end) {
    EngineNews news{0, 0, 0, {engine_.channel(0)}, {}};
    pulse::ChannelState& state = news.channels.front();
    state.ended = state.following;
    state.following = 0;
    state.end = end;
    activity::Outputs out;
    controller_.handle({clock_.now(), 0, 0, news}, out);
  }

  void turnEnded(const MachineSnapshot& /*before*/,
                 const std::shared_ptr<const MachineSnapshot>& /*now*/,
                 activity::Outputs& out) override {
    for (auto& [call, reply] : out.answers) answers_[call] = std::move(reply);
  }
  void write(const activity::PinJob& job) override {
    const gpio::LineWrite line{job.output, job.level};
    written_.push_back({job.id, lines_->write(&line, 1)});
  }
  void onNews() noexcept override { core_.noteNews(); }

 private:
  axis::LineNames names() const {
    axis::LineNames names;
    for (const gpio::OutputRequest& output : wiring_.outputs) names.outputs.push_back(output.line);
    for (const gpio::InputRequest& input : wiring_.inputs) names.inputs.push_back(input.line);
    return names;
  }

  const std::vector<config::AxisConfig> configs_{test::linearAxis("x")};
  pulse::VirtualClock clock_;
  sim::Rig rig_{{test::rigAxis(configs_[0])}};
  gpio::SimulatedBackend backend_{rig_, [this] { return clock_.now(); }};
  const Wiring wiring_{configs_, MachineOptions()};
  std::shared_ptr<gpio::Lines> lines_{backend_.request(wiring_.outputs, wiring_.inputs)};
  pulse::PulseEngine engine_{*lines_, clock_, wiring_.channels, 5'000'000};
  Controller controller_{configs_, wiring_.motor_lines, names(), {}, EmergencyDisable::kHold};
  ShellCore core_{controller_, engine_, clock_, lines_, wiring_.inputs.size(), *this, nullptr};
  pulse::Nanoseconds engine_due_ = 0;
  activity::CallId calls_ = 0;
  std::map<activity::CallId, activity::Reply> answers_;
  std::vector<activity::PinDone> written_;
};

// Nobody has told the controller of the switch before the request is taken.
TEST(ShellCore, TellsTheLevelsThatCameWithARequestBeforeIt) {
  ByHand machine;
  machine.pressMaxSwitch();
  const activity::CallId move = machine.post(MoveTo{0, 0.01, false, 0.0});
  EXPECT_TRUE(machine.core().takeRequest());
  ASSERT_TRUE(machine.answer(move).failure);
  EXPECT_NE(machine.answer(move).failure->text.find("the max endstop is active"),
            std::string::npos);
}

TEST(ShellCore, NamesTheCallsThatAreOpenWhenItCloses) {
  ByHand machine;
  const activity::CallId move = machine.post(MoveTo{0, 0.01, false, 0.0});
  EXPECT_EQ(machine.core().close(), std::vector<activity::CallId>{move});
  EXPECT_FALSE(machine.core().takeRequest());
  EXPECT_EQ(machine.core().post(100, StopAll{}), "the machine was shut down");
}

// A recover may clear the fault first, and it may be the fault of an axis that shares the motors.
TEST(ShellCore, SaysWhyAMotionHasEndedIfItsAxisHasNoFaultAnyMore) {
  for (const auto end :
       {pulse::EndReason::kEmergencyStop, pulse::EndReason::kChipFault, pulse::EndReason::kTooLate,
        pulse::EndReason::kLineError, pulse::EndReason::kNotInPosition, pulse::EndReason::kSkewed,
        pulse::EndReason::kBlocked, pulse::EndReason::kCompanion, pulse::EndReason::kEndstopMin,
        pulse::EndReason::kDone}) {
    ByHand machine;
    const activity::Reply reply = machine.answerOf(MoveTo{0, 0.01, false, 0.0});
    const axis::Move move = std::get<std::vector<axis::Move>>(reply.value).front();
    machine.endMotion(end);
    const auto result = move.outcome->get();
    ASSERT_TRUE(result) << static_cast<int>(end);
    EXPECT_NE(result->end, axis::MoveEnd::kReached);
    EXPECT_NE(result->message.back(), ' ') << result->message;
  }
}

TEST(ShellCore, RefusesARequestIfTooManyWait) {
  ByHand machine;
  for (int i = 0; i < 256; ++i) machine.post(StopAll{});
  EXPECT_EQ(machine.core().post(1'000, StopAll{}), "too many requests are already waiting");
  machine.settle();
  EXPECT_FALSE(machine.answerOf(StopAll{}).failure);
}

// Such as before its first write: then no line is to blame.
TEST(ShellCore, SaysThatTheEngineHangsWhereverItDoes) {
  for (const int line : {-1, 0}) {
    ByHand machine;
    machine.core().handle(EngineHangs{{ETIMEDOUT, line}});
    const std::string fault = machine.core().snapshot()->axes.front().state.fault;
    const char* const wanted = line < 0
                                   ? "the thread that makes the pulses hangs, at none of its lines"
                                   : "the ENABLE line x.enable";
    EXPECT_NE(fault.find(wanted), std::string::npos) << fault;
  }
}

}  // namespace
}  // namespace stepdriver::machine
