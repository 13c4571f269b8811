#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "port/klipper/board_backend.h"
#include "setup/simulated_link.h"
#include "sim/fake_board.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/gpio/simulated_lines.h"

namespace stepdriver::test {

/// The pins of a fake board on lines of a test: outputs have the numbers of the lines, inputs those
/// from kFirstInput on.
class PinsOnLines : public sim::BoardPins {
 public:
  static constexpr unsigned kFirstInput = 40;

  explicit PinsOnLines(gpio::Lines& lines) : lines_(lines) {}
  bool drive(unsigned pin, bool level) override {
    if (pin >= kFirstInput) return false;
    if (level) write(pin, level);
    return true;
  }
  bool listen(unsigned pin) override { return pin >= kFirstInput; }
  void write(unsigned pin, bool level) override {
    const gpio::LineWrite write{static_cast<int>(pin), level};
    static_cast<void>(lines_.write(&write, 1));
  }
  bool read(unsigned pin) override { return lines_.read(static_cast<int>(pin - kFirstInput)) > 0; }

 private:
  gpio::Lines& lines_;
};

/// No lines but those of boards.
class NoBackend : public gpio::Backend {
 public:
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& /*outputs*/,
                                       const std::vector<gpio::InputRequest>& /*inputs*/) override {
    return nullptr;
  }
};

/// The port of a board, on a fake one.
class PortOnBoard {
 public:
  using MakeLink = std::function<std::unique_ptr<klipper::Link>(sim::FakeBoard& board)>;

  /// @param lines, clock outlive this. @param link another line to the fake board.
  PortOnBoard(gpio::Lines& lines, pulse::Clock& clock,
              const std::vector<pulse::ChannelConfig>& channels, sim::BoardKind kind,
              double drift_ppm = 0.0, const MakeLink& link = {})
      : pins(lines),
        // Shortly before the end of its counter.
        board(pins, wider(std::move(kind)), drift_ppm, 0xFFFF0000U),
        backend(none_, clock, {{"mcu", "fake"}},
                [this, &clock, link](const klipper::BoardSettings& /*of*/) {
                  return link ? link(board) : std::make_unique<setup::SimulatedLink>(board, clock);
                }),
        held(backend.request(outputsOf(channels), inputsOf(channels))),
        port_(backend.makePort(*held, clock, channels)),
        port(*port_) {}

 private:
  NoBackend none_;

  static sim::BoardKind wider(sim::BoardKind kind) {
    kind.pins = 80;
    return kind;
  }
  template <typename Use>
  static void each(const std::vector<pulse::ChannelConfig>& channels, const Use& use) {
    for (const pulse::ChannelConfig& channel : channels) {
      use(static_cast<const pulse::MotorSignals&>(channel));
      for (const pulse::MotorSignals& twin : channel.twins) use(twin);
    }
  }
  static std::vector<gpio::OutputRequest> outputsOf(
      const std::vector<pulse::ChannelConfig>& channels) {
    int last = 0;
    each(channels, [&](const pulse::MotorSignals& motor) {
      last = std::max({last, motor.step.line, motor.dir.line});
    });
    std::vector<gpio::OutputRequest> outputs;
    for (int i = 0; i <= last; ++i) {
      outputs.push_back({"mcu:gpio" + std::to_string(i), false, false});
    }
    return outputs;
  }
  static std::vector<gpio::InputRequest> inputsOf(
      const std::vector<pulse::ChannelConfig>& channels) {
    int last = -1;
    each(channels, [&](const pulse::MotorSignals& motor) {
      for (const auto& signal : {motor.endstop_min, motor.endstop_max, motor.fault}) {
        if (signal) last = std::max(last, signal->line);
      }
    });
    std::vector<gpio::InputRequest> inputs;
    for (int i = 0; i <= last; ++i) {
      inputs.push_back(
          {"mcu:gpio" + std::to_string(PinsOnLines::kFirstInput + static_cast<unsigned>(i))});
    }
    return inputs;
  }

 public:
  PinsOnLines pins;
  sim::FakeBoard board;
  klipper::BoardBackend backend;
  std::unique_ptr<gpio::Lines> held;

 private:
  std::unique_ptr<pulse::StepPort> port_;

 public:
  pulse::StepPort& port;
};

}  // namespace stepdriver::test
