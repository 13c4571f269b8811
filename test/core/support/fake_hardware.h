#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "pulse/hybrid_wait.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::test {

/// A clock that counts as real time, with a given lateness.
class LateClock : public pulse::Clock {
 public:
  using Nanoseconds = pulse::Nanoseconds;

  Nanoseconds now() override { return now_; }
  void waitUntil(Nanoseconds time) override { wait(time, spun); }
  void sleepUntil(Nanoseconds time) override { wait(time, slept); }
  Nanoseconds guard() const override { return spin_guard; }
  void wake() override {}
  bool realtime() const override { return is_realtime; }

  void pass(Nanoseconds time) { now_ += time; }

  /// The lateness of the next wait that is longer than pulse::HybridWait::kShortWait.
  std::function<Nanoseconds()> spun = [] { return 0; };
  std::function<Nanoseconds()> slept = [] { return 0; };
  Nanoseconds spin_guard = 0;
  bool is_realtime = true;

 private:
  void wait(Nanoseconds time, const std::function<Nanoseconds()>& late) {
    if (now_ >= time) return;
    // The pulse thread's clock spins then.
    const bool is_short = time - now_ <= pulse::HybridWait::kShortWait;
    now_ = time + (is_short ? 0 : late());
  }

  Nanoseconds now_ = 1'000'000'000;
};

/// Lines whose calls take time on a LateClock. They remember what was written; inputs read high.
class SlowBackend : public gpio::Backend {
 public:
  explicit SlowBackend(LateClock& clock) : clock_(clock) {}

  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override;

  /// The duration of the next call.
  std::function<pulse::Nanoseconds()> write_cost = [] { return 0; };
  std::function<pulse::Nanoseconds(const std::string& line)> read_cost = [](const auto&) {
    return 0;
  };
  int write_error = 0;  ///< errno of every write
  int read_error = 0;

  struct Write {
    std::string line;
    bool level;
    bool edge;  ///< it had the other level before
    pulse::Nanoseconds time;
  };
  std::vector<Write> written;
  bool held = false;

 private:
  class Held;
  LateClock& clock_;
};

class SlowBackend::Held : public gpio::Lines {
 public:
  Held(SlowBackend& backend, std::vector<gpio::OutputRequest> outputs,
       std::vector<gpio::InputRequest> inputs)
      : backend_(backend), outputs_(std::move(outputs)), inputs_(std::move(inputs)) {
    for (const auto& output : outputs_) levels_.push_back(output.safe_level);
    backend_.held = true;
  }
  ~Held() override { backend_.held = false; }

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    backend_.clock_.pass(backend_.write_cost());
    const pulse::Nanoseconds now = backend_.clock_.now();
    for (std::size_t i = 0; i < count; ++i) {
      const auto output = static_cast<std::size_t>(writes[i].output);
      backend_.written.push_back(
          {outputs_[output].line, writes[i].level, levels_[output] != writes[i].level, now});
      levels_[output] = writes[i].level;
    }
    return backend_.write_error;
  }
  int read(int input) noexcept override {
    backend_.clock_.pass(backend_.read_cost(inputs_[static_cast<std::size_t>(input)].line));
    return backend_.read_error == 0 ? 1 : -backend_.read_error;
  }
  int waitForEdges(std::int64_t, gpio::EdgeEvent*, std::size_t) noexcept override { return 0; }
  void interrupt() noexcept override {}
  const std::string& outputName(int output) const override {
    return outputs_[static_cast<std::size_t>(output)].line;
  }
  const std::string& inputName(int input) const override {
    return inputs_[static_cast<std::size_t>(input)].line;
  }

 private:
  SlowBackend& backend_;
  const std::vector<gpio::OutputRequest> outputs_;
  const std::vector<gpio::InputRequest> inputs_;
  std::vector<bool> levels_;
};

inline std::unique_ptr<gpio::Lines> SlowBackend::request(
    const std::vector<gpio::OutputRequest>& outputs,
    const std::vector<gpio::InputRequest>& inputs) {
  return std::make_unique<Held>(*this, outputs, inputs);
}

}  // namespace stepdriver::test
