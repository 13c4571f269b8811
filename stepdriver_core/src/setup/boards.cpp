#include "boards.h"

#include <fmt/format.h>

#include <map>
#include <string>
#include <utility>

#include "nanoseconds.h"
#include "port/klipper/board_backend.h"
#include "port/klipper/tty_link.h"
#include "sim/fake_board.h"
#include "simulated_link.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::setup {
namespace {

/// The pins of a fake board, which are lines `board:gpio12` of the rig.
class PinsOnRig : public sim::BoardPins {
 public:
  PinsOnRig(gpio::Backend& rig, std::string board) : rig_(rig), board_(std::move(board)) {}

  bool drive(unsigned pin, bool level) override {
    std::unique_ptr<gpio::Lines>& line = lines_[pin];
    line.reset();  // it may have been an output before
    line = rig_.request({{nameOf(pin), level, true}}, {});
    return true;
  }
  bool listen(unsigned pin) override {
    std::unique_ptr<gpio::Lines>& line = lines_[pin];
    line.reset();
    line = rig_.request({}, {{nameOf(pin)}});
    return true;
  }
  void write(unsigned pin, bool level) override {
    const gpio::LineWrite write{0, level};
    static_cast<void>(lines_.at(pin)->write(&write, 1));
  }
  bool read(unsigned pin) override { return lines_.at(pin)->read(0) > 0; }

 private:
  std::string nameOf(unsigned pin) const { return board_ + ":gpio" + std::to_string(pin); }

  gpio::Backend& rig_;
  const std::string board_;
  std::map<unsigned, std::unique_ptr<gpio::Lines>> lines_;
};

/// A line to a fake board of its own, which has just been switched on.
class RigLink : public klipper::Link {
 public:
  RigLink(gpio::Backend& rig, const std::string& name, pulse::Clock& clock)
      : pins_(rig, name), board_(pins_, sim::rp2040()), link_(board_, clock) {}

  std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override {
    return link_.write(bytes, count);
  }
  std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override {
    return link_.read(bytes, most);
  }
  void await(pulse::Nanoseconds timeout) override { link_.await(timeout); }
  pulse::Nanoseconds due() const override { return link_.due(); }

 private:
  PinsOnRig pins_;
  sim::FakeBoard board_;
  SimulatedLink link_;
};

}  // namespace

std::vector<DriverFinding> checkBoards(const std::vector<BoardConfig>& boards) {
  std::vector<DriverFinding> findings;
  for (const BoardConfig& config : boards) {
    try {
      pulse::SteadyClock clock;
      klipper::Board board(config.name,
                           [&config] {
                             return std::make_unique<klipper::TtyLink>(config.name, config.port,
                                                                       config.baud);
                           },
                           clock, {});
      board.identify();
      findings.push_back(
          {true, fmt::format("{}: {} at {:g} MHz, firmware {}", config.name, board.mcu(),
                             board.boardClock().nominal() * 1e-6, board.version())});
    } catch (const Error& error) {
      findings.push_back({false, error.what()});
    }
  }
  return findings;
}

std::unique_ptr<gpio::Backend> makeBoards(const std::vector<BoardConfig>& boards,
                                          gpio::Backend& base, pulse::Clock& clock,
                                          bool simulated) {
  std::vector<klipper::BoardSettings> settings;
  std::map<std::string, int> bauds;
  for (const BoardConfig& board : boards) {
    settings.push_back({board.name, board.port, nanoseconds(board.ahead),
                        nanoseconds(board.step_error), board.reset});
    bauds[board.name] = board.baud;
  }
  return std::make_unique<klipper::BoardBackend>(
      base, clock, std::move(settings),
      [simulated, &base, &clock,
       bauds](const klipper::BoardSettings& board) -> std::unique_ptr<klipper::Link> {
        if (simulated) return std::make_unique<RigLink>(base, board.name, clock);
        return std::make_unique<klipper::TtyLink>(board.name, board.port, bauds.at(board.name));
      });
}

}  // namespace stepdriver::setup
