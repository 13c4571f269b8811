#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "port/klipper/board.h"
#include "port/klipper/link.h"
#include "port/port_backend.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::klipper {

/// A board, as a configuration describes it.
struct BoardSettings {
  std::string name;  ///< its lines are `name:pin`
  std::string port;
  Nanoseconds ahead = 50'000'000;  ///< how long before its time a step is sent
  Nanoseconds step_error = 0;      ///< 0: a tick of its clock
  bool resets_foreign = false;
};

/// Lines of boards, together with those of another backend, and the port that plays the steps of
/// motors on the boards.
///
/// The lines of STEP and DIR of all motors are on boards, or none is used for steps at all. A motor
/// has its lines of STEP, DIR, switches and fault on one board.
class BoardBackend final : public pulse::PortBackend {
 public:
  using MakeLink = std::function<std::unique_ptr<Link>(const BoardSettings& board)>;

  /// @param base has the lines that are on no board; outlives this.
  /// @param link opens the line to a board. @param clock outlives this.
  BoardBackend(gpio::Backend& base, pulse::Clock& clock, std::vector<BoardSettings> boards,
               MakeLink link);
  ~BoardBackend() override;

  /// @throw Error if a board doesn't answer, has another firmware, or lacks a pin.
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override;
  SerialExchange simulatedSerial(const std::string& port) override {
    return base_.simulatedSerial(port);
  }
  std::unique_ptr<pulse::StepPort> makePort(
      gpio::Lines& lines, pulse::Clock& clock,
      const std::vector<pulse::ChannelConfig>& lanes) override;
  void restore(gpio::Lines& lines) override;

 private:
  class HeldLines;

  gpio::Backend& base_;
  pulse::Clock& clock_;
  const std::vector<BoardSettings> settings_;
  const MakeLink make_link_;
  HeldLines* held_ = nullptr;  // of the last request
};

}  // namespace stepdriver::klipper
