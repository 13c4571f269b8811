#include "storm/pulses.h"

#include <cstdint>
#include <set>
#include <stdexcept>
#include <utility>

#include "support/half_steps.h"

namespace stepdriver::storm {
namespace {

using Trace = std::map<std::string, node_test::Waveform>;

/// The level of a waveform at times that never decrease.
class Level {
 public:
  explicit Level(const node_test::Waveform& waveform) : edges_(waveform.edges) {}

  bool at(std::int64_t time) {
    while (next_ < edges_.size() && edges_[next_].time_ns <= time) ++next_;
    return next_ > 0 && edges_[next_ - 1].level;
  }

 private:
  const std::vector<node_test::Waveform::Edge>& edges_;
  std::size_t next_ = 0;
};

/// The number of 1/16 steps of a pulse, by the levels of MS1 to MS3: the table of the A4988's
/// datasheet.
int sixteenths(bool ms1, bool ms2, bool ms3) {
  switch ((ms1 ? 1 : 0) + (ms2 ? 2 : 0) + (ms3 ? 4 : 0)) {
    case 0:
      return 16;
    case 1:
      return 8;
    case 2:
      return 4;
    case 3:
      return 2;
    case 7:
      return 1;
    default:
      throw std::runtime_error("a pulse with undefined microstep pins");
  }
}

/// The number of 1/16 steps of a pulse at times that never decrease.
class StepSize {
 public:
  StepSize(const Trace& trace, const std::string& axis) {
    // A driver with registers has no such pins, and stays in its mode.
    if (trace.count(axis + "/ms1") == 0) return;
    for (const char* pin : {"/ms1", "/ms2", "/ms3"}) pins_.emplace_back(trace.at(axis + pin));
  }

  int at(std::int64_t time) {
    if (pins_.empty()) return 1;
    return sixteenths(pins_[0].at(time), pins_[1].at(time), pins_[2].at(time));
  }

 private:
  std::vector<Level> pins_;
};

// All that a write switches has one time. Coils that go off together keep the motor's place.
std::vector<Pulse> pulsesOfCoils(const Trace& trace, const std::string& axis) {
  std::vector<Level> coils;
  std::set<std::int64_t> times;
  for (const char* coil : {"/in1", "/in2", "/in3", "/in4"}) {
    const node_test::Waveform& waveform = trace.at(axis + coil);
    coils.emplace_back(waveform);
    for (const auto& edge : waveform.edges) times.insert(edge.time_ns);
  }
  std::vector<Pulse> pulses;
  std::int64_t count = 0;
  int last = 0;  // A motor that has never turned begins with the first half step.
  for (const std::int64_t time : times) {
    test::Coils on{};
    for (std::size_t i = 0; i < on.size(); ++i) on.at(i) = coils[i].at(time);
    const auto now = test::halfStepOf(on);
    if (!now) continue;
    const int way = test::wayBetween(std::exchange(last, *now), *now);
    if (way == 0) continue;
    count += way;
    pulses.push_back({time, count});
  }
  return pulses;
}

}  // namespace

std::vector<Pulse> pulsesOf(const Trace& trace, const std::string& axis) {
  if (trace.count(axis + "/in1") != 0) return pulsesOfCoils(trace, axis);
  Level dir(trace.at(axis + "/dir"));
  StepSize step_size(trace, axis);
  std::vector<Pulse> pulses;
  std::int64_t count = 0;
  const auto& step = trace.at(axis + "/step").edges;
  const bool both_edges = trace.at(axis + "/step").both_edges;
  for (std::size_t i = 1; i < step.size(); ++i) {
    if (!step[i].level && !both_edges) continue;
    const std::int64_t time = step[i].time_ns;
    const int size = step_size.at(time);
    count += dir.at(time) ? size : -size;
    pulses.push_back({time, count});
  }
  return pulses;
}

}  // namespace stepdriver::storm
