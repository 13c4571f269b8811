#include "machine/shell_core.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "machine/wiring.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "support/bench.h"
#include "support/homing_kinds_bench.h"

namespace stepdriver::machine {
namespace {

/// One axis on the rig, and an input that it presses from 1 to 1.5 mm. Each event is handled when
/// the test says so; slow lines are written at once.
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
  /// Time passes, in which nobody takes the edges of the inputs.
  void passUnwatched(pulse::Nanoseconds time) {
    const pulse::Nanoseconds end = clock_.now() + time;
    for (settle(); clock_.now() < end; settle()) {
      clock_.waitUntil(std::min({core_.due(), engine_due_, end}));
    }
  }
  /// The thread that watches the inputs has its turn, until no edge is left.
  /// @param loses the edges that were reported are lost
  void watch(bool loses = false) {
    std::array<gpio::EdgeEvent, 16> edges{};
    if (loses) {
      EXPECT_GT(lines_->waitForEdges(0, edges.data(), edges.size()), 0);
    }
    for (int count = 1; count > 0;) {
      const pulse::Nanoseconds asked = clock_.now();
      count = lines_->waitForEdges(0, edges.data(), edges.size());
      core_.watchInputs(edges.data(), count, asked);
    }
    while (core_.takeInput()) {
    }
    settle();
  }
  BeginLatch latch(LatchEdge edge, bool every) {
    BeginLatch latch;
    latch.id = 1;
    latch.wanted.input = "flag";
    latch.wanted.edge = edge;
    latch.wanted.every = every;
    latch.axes = {0};
    latch.record = std::make_shared<LatchRecord>();
    return latch;
  }
  std::vector<std::int64_t> flagTimes(bool level) const {
    return trace_->times("x", "flag1", level);
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

  static MachineOptions withFlag() {
    MachineOptions options;
    options.inputs = {test::inputNamed("flag")};
    return options;
  }
  static sim::RigAxisSpec passingFlag(const config::AxisConfig& config) {
    sim::RigAxisSpec spec = test::rigAxis(config);
    spec.flags = {test::flagOf("flag", 1.0, 1.5)};
    return spec;
  }

  const std::vector<config::AxisConfig> configs_{test::linearAxis("x")};
  const MachineOptions options_ = withFlag();
  pulse::VirtualClock clock_;
  std::shared_ptr<sim::MemoryTrace> trace_ = std::make_shared<sim::MemoryTrace>();
  sim::Rig rig_{{passingFlag(configs_[0])}, trace_, {}, {}, test::Bench::ioOf(options_)};
  gpio::SimulatedBackend backend_{rig_, [this] { return clock_.now(); }};
  const Wiring wiring_{configs_, options_};
  std::shared_ptr<gpio::Lines> lines_{backend_.request(wiring_.outputs, wiring_.inputs)};
  pulse::PulseEngine engine_{*lines_, clock_, wiring_.channels, 5'000'000};
  Controller controller_{configs_,
                         wiring_.motor_lines,
                         names(),
                         {},
                         EmergencyDisable::kHold,
                         wiring_.motorPower(options_),
                         wiring_.namedLines(options_)};
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

// ---- edges that are taken late ----

// The levels that come with requests tell of the change long before the edges.
TEST(ShellCore, WaitsForEdgesThatNobodyHasTakenHoweverLongThatTakes) {
  ByHand machine;
  const BeginLatch latch = machine.latch(LatchEdge::kEither, true);
  EXPECT_FALSE(machine.answerOf(latch).failure);
  EXPECT_FALSE(machine.answerOf(MoveTo{0, 0.0012, false, 0.0}).failure);
  for (int i = 0; i < 50; ++i) {
    machine.passUnwatched(10'000'000);
    EXPECT_FALSE(machine.answerOf(SetSpeedOverride{1.0}).failure);
  }
  // It has been on, off, and on again.
  EXPECT_FALSE(machine.answerOf(MoveTo{0, 0.002, false, 0.0}).failure);
  machine.passUnwatched(500'000'000);
  EXPECT_FALSE(machine.answerOf(MoveTo{0, 0.0012, false, 0.0}).failure);
  machine.passUnwatched(500'000'000);
  EXPECT_TRUE(latch.record->take().empty());
  machine.watch();
  const std::vector<LatchedEdge> edges = latch.record->take();
  ASSERT_EQ(edges.size(), 3U);
  const std::vector<std::int64_t> rises = machine.flagTimes(true);
  EXPECT_EQ(edges[0].time, rises.at(0));
  EXPECT_EQ(edges[1].time, machine.flagTimes(false).at(0));
  EXPECT_EQ(edges[2].time, rises.at(1));
  for (const LatchedEdge& edge : edges) EXPECT_FALSE(edge.was_read) << edge.number;
}

TEST(ShellCore, SaysOfAnEdgeThatWasLostThatItWasRead) {
  ByHand machine;
  const BeginLatch latch = machine.latch(LatchEdge::kEither, true);
  EXPECT_FALSE(machine.answerOf(latch).failure);
  EXPECT_FALSE(machine.answerOf(MoveTo{0, 0.0012, false, 0.0}).failure);
  machine.passUnwatched(500'000'000);
  machine.watch(true);
  EXPECT_TRUE(latch.record->take().empty()) << "its edge may still be reported";
  EXPECT_NE(machine.core().edgesDue(), pulse::kNever);
  machine.passUnwatched(10'000'000);
  machine.watch();
  const std::vector<LatchedEdge> edges = latch.record->take();
  ASSERT_EQ(edges.size(), 1U);
  EXPECT_TRUE(edges[0].was_read);
  EXPECT_EQ(machine.core().edgesDue(), pulse::kNever);
}

// The axis has come to rest at its target before anybody has taken the edge of its last step.
TEST(ShellCore, FindsAContactWhoseEdgeIsTakenAfterTheEndOfItsMotion) {
  ByHand machine;
  ProbeStroke stroke;
  stroke.line.axes = {0};
  stroke.line.positions = {0.001};
  stroke.latch = machine.latch(LatchEdge::kActive, false);
  stroke.stops = {machine.core().snapshot()->axes.at(0).stopsOtherThanHolds()};
  const auto record = stroke.latch->record;
  const auto begin = stroke.begin;
  EXPECT_FALSE(machine.answerOf(stroke).failure);
  EXPECT_EQ(*begin, std::vector<double>{0.0});
  machine.passUnwatched(1'000'000'000);
  EXPECT_FALSE(machine.core().snapshot()->axes.front().state.moving);
  EXPECT_FALSE(record->result()) << record->result()->message;
  machine.watch();
  ASSERT_TRUE(record->result());
  ASSERT_TRUE(record->result()->latched) << record->result()->message;
  EXPECT_EQ(record->result()->edge->time, machine.flagTimes(true).front());
}

}  // namespace
}  // namespace stepdriver::machine
