#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "bus/open_port.h"
#include "bus/register_job.h"
#include "driver/tmc_registers.h"
#include "message_text.h"
#include "motor/tmc_chip.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::setup {
namespace {

namespace tmc = driver::tmc;

constexpr int kAddresses = 4;

/// A pin whose level the chip tells in IOIN.
struct ToldPin {
  unsigned bit;
  const char* name;
};
constexpr std::array<ToldPin, 6> kToldPins{
    {{0, "ENN"}, {2, "MS1"}, {3, "MS2"}, {7, "STEP"}, {8, "SPREAD"}, {9, "DIR"}}};

/// A line that is tested, and the bit of its pin.
struct TestedPin {
  const char* key;
  config::Pin config::Pins::*pin;
  unsigned bit;
};
constexpr std::array<TestedPin, 3> kTestedPins{{{"pins/enable", &config::Pins::enable, 0},
                                                {"pins/step", &config::Pins::step, 7},
                                                {"pins/dir", &config::Pins::dir, 9}}};

/// IOIN of a chip on SPI with the pins at the bits of kToldPins.
std::uint32_t asOnUart(std::uint32_t ioin) {
  return (ioin >> 4U & 1U) | (ioin & 1U) << 7U | (ioin >> 1U & 1U) << 9U;
}

const char* nameOfBit(unsigned bit) {
  for (const ToldPin& pin : kToldPins) {
    if (pin.bit == bit) return pin.name;
  }
  return "?";
}

class DriverCheck {
 public:
  DriverCheck(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend)
      : axes_(axes), backend_(backend) {
    for (const config::AxisConfig& axis : axes) {
      for (std::size_t i = 0; i < axis.motors(); ++i) {
        const config::MotorConfig& motor = axis.motorAt(i);
        if (!motor.tmc) continue;
        chips_.push_back(
            {axis.name + (motor.motor.empty() ? "" : "/" + motor.motor), &motor, axis.microsteps});
        addresses_[motor.tmc->port].push_back(motor.tmc->address);
      }
    }
  }

  std::vector<DriverFinding> run(bool wiring) {
    bool all_answer = !chips_.empty();
    for (const Chip& chip : chips_) all_answer = ask(chip, wiring) && all_answer;
    tellSlowPorts();
    if (!wiring || chips_.empty()) return findings_;
    if (all_answer) {
      testLines();
    } else {
      say(false, "the lines weren't tested: not all outputs of the drivers could be switched off");
    }
    return findings_;
  }

 private:
  struct Chip {
    std::string name;
    const config::MotorConfig* motor;
    int microsteps;
  };
  /// A pin of a chip.
  struct Place {
    std::size_t chip;
    unsigned bit;
    bool inverted;  // its level is the other one than that of the line
    bool operator==(const Place& other) const { return chip == other.chip && bit == other.bit; }
  };

  void say(bool is_right, std::string text) { findings_.push_back({is_right, std::move(text)}); }

  bus::RegisterPort& portOf(const config::TmcConfig& tmc) {
    std::unique_ptr<bus::RegisterPort>& port = ports_[tmc.port];
    if (port == nullptr) {
      port = bus::openPort(tmc.port, tmc.baud, backend_.simulatedSerial(tmc.port));
    }
    return *port;
  }

  /// @param switches_off its outputs. @return whether the chip is there.
  bool ask(const Chip& chip, bool switches_off) {
    const config::TmcConfig& config = *chip.motor->tmc;
    motor::TmcChip asked(*chip.motor);
    bus::RegisterJob job = asked.setUp(chip.microsteps, addresses_[config.port]);
    // The set-up begins with the question for its version, and with its outputs off.
    const auto last = std::find_if(
        job.accesses.begin(), job.accesses.end(), [switches_off](const bus::RegisterAccess& one) {
          return switches_off ? one.number == tmc::kChopconf
                              : one.kind == bus::RegisterAccess::Kind::kExpect;
        });
    job.accesses.erase(last + 1, job.accesses.end());
    bus::RegisterDone done;
    try {
      done = carryOut(job, portOf(config), {});
    } catch (const bus::PortError& error) {
      done.failure = bus::Failure::kPort;
      done.port_error = error.what();
    }
    const std::string& title = chip.motor->driver.title;
    if (done.failure == bus::Failure::kNone) {
      const std::string address =
          config.baud == 0 ? "" : fmt::format(" at address {}", config.address);
      say(true, fmt::format("{}: the {} answers on {}{}", chip.name, title, config.port, address));
      return true;
    }
    std::string text = fmt::format("{}: the {} {}", chip.name, title, asked.takeSetUp(done));
    if (done.failure == bus::Failure::kOnlyEcho) text += others(config);
    say(false, text);
    return false;
  }

  /// A port that takes longer than the node's period of asking makes faults known later.
  void tellSlowPorts() {
    // Three registers, each read twice: 4 bytes and 8, of 10 bits each, and the chip's delay of 24
    // bits before its answer.
    constexpr double kBits = 6.0 * (12.0 * 10.0 + 24.0);
    constexpr double kPeriod = 0.25;  // [s] of asking each chip
    for (const auto& [port, addresses] : addresses_) {
      const auto uses = [&port = port](const Chip& chip) { return chip.motor->tmc->port == port; };
      const int baud = std::find_if(chips_.begin(), chips_.end(), uses)->motor->tmc->baud;
      if (baud == 0) continue;
      const double time = kBits * static_cast<double>(addresses.size()) / baud;
      if (time <= kPeriod) continue;
      say(true, fmt::format("{}: at {} baud, asking its {} drivers how they are takes {:.2g} s: "
                            "their faults are known by that much later than at 115200",
                            port, baud, addresses.size(), time));
    }
  }

  /// The addresses at which chips answer that aren't configured.
  std::string others(const config::TmcConfig& config) {
    const std::vector<int>& known = addresses_[config.port];
    std::vector<std::string> found;
    for (int address = 0; address < kAddresses; ++address) {
      if (std::find(known.begin(), known.end(), address) != known.end()) continue;
      std::uint32_t value = 0;
      const auto failure =
          portOf(config).read(static_cast<std::uint8_t>(address), tmc::kIoin, ~0xFF000000U, value);
      if (failure == bus::Failure::kNone) found.push_back(std::to_string(address));
    }
    return found.empty() ? "" : "; but a chip answers at address " + listText(found, "and");
  }

  // ---- the wiring ----

  void testLines() {
    std::vector<gpio::OutputRequest> requests;
    for (const Chip& chip : chips_) {
      for (const TestedPin& tested : kTestedPins) {
        const config::Pin& pin = chip.motor->pins.*tested.pin;
        if (!pin.wired() || isOfOthers(pin.line) || indexOf(requests, pin.line)) continue;
        // ENABLE off, STEP inactive.
        const bool level = tested.bit == 0 ? !chip.motor->driver.enable_on
                                           : tested.bit == 7 && !chip.motor->driver.step_active;
        requests.push_back({pin.line, level != pin.inverted, false});
      }
    }
    const std::unique_ptr<gpio::Lines> lines = backend_.request(requests, {});
    for (std::size_t i = 0; i < chips_.size(); ++i) {
      for (const TestedPin& tested : kTestedPins) {
        const config::Pin& pin = chips_[i].motor->pins.*tested.pin;
        if (!pin.wired()) continue;
        const auto index = indexOf(requests, pin.line);
        if (!index) {
          say(true,
              fmt::format("{}: {} ({}) wasn't tested: it also goes to a driver without registers",
                          chips_[i].name, tested.key, pin.line));
          continue;
        }
        judge(i, tested, reached(*lines, *index, requests[*index].safe_level));
      }
    }
  }

  /// Whether a motor whose driver has no registers, whose current could be switched, has this line.
  bool isOfOthers(const std::string& line) const {
    for (const config::AxisConfig& axis : axes_) {
      for (std::size_t i = 0; i < axis.motors(); ++i) {
        const config::MotorConfig& motor = axis.motorAt(i);
        if (!motor.tmc && motor.pins.enable.line == line) return true;
      }
    }
    return false;
  }

  static std::optional<std::size_t> indexOf(const std::vector<gpio::OutputRequest>& requests,
                                            const std::string& line) {
    for (std::size_t i = 0; i < requests.size(); ++i) {
      if (requests[i].line == line) return i;
    }
    return {};
  }

  /// The pins that follow a line.
  std::vector<Place> reached(gpio::Lines& lines, std::size_t output, bool safe_level) {
    std::array<std::vector<std::uint32_t>, 2> levels;
    for (const bool level : {!safe_level, safe_level}) {
      const gpio::LineWrite write{static_cast<int>(output), level};
      if (const int error = lines.write(&write, 1); error != 0) {
        throw GpioError(fmt::format("line {} can't be written: error {}",
                                    lines.outputName(write.output), error));
      }
      for (const Chip& chip : chips_) levels.at(level ? 1 : 0).push_back(ioinOf(chip));
    }
    std::vector<Place> places;
    for (std::size_t i = 0; i < chips_.size(); ++i) {
      for (const ToldPin& pin : kToldPins) {
        const bool high = (levels[1][i] >> pin.bit & 1U) != 0;
        const bool low = (levels[0][i] >> pin.bit & 1U) != 0;
        if (high != low) places.push_back({i, pin.bit, low});
      }
    }
    return places;
  }

  /// IOIN; 0 if the chip doesn't answer any more: then nothing follows.
  std::uint32_t ioinOf(const Chip& chip) {
    std::uint32_t value = 0;
    const config::TmcConfig& config = *chip.motor->tmc;
    const tmc::Model model = tmc::modelOf(chip.motor->driver.name);
    const auto failure = portOf(config).read(static_cast<std::uint8_t>(config.address),
                                             tmc::ioinOf(model), 0, value);
    if (failure != bus::Failure::kNone) return 0;
    return tmc::isOnSpi(model) ? asOnUart(value) : value;
  }

  std::string textOf(const Place& place, std::size_t own) const {
    const std::string pin = nameOfBit(place.bit);
    return place.chip == own ? pin : pin + " of " + chips_[place.chip].name;
  }

  /// A line may be meant to go to several chips.
  bool isMeant(const Place& place, const std::string& line) const {
    for (const TestedPin& tested : kTestedPins) {
      if (tested.bit != place.bit) continue;
      return (chips_[place.chip].motor->pins.*tested.pin).line == line;
    }
    return false;
  }

  void judge(std::size_t own, const TestedPin& tested, const std::vector<Place>& places) {
    const config::Pin& pin = chips_[own].motor->pins.*tested.pin;
    const std::string begin = fmt::format("{}: {} ({})", chips_[own].name, tested.key, pin.line);
    const char* const wanted = nameOfBit(tested.bit);
    std::vector<std::string> wrong;
    const Place* arrived = nullptr;
    for (const Place& place : places) {
      if (place == Place{own, tested.bit, false}) {
        arrived = &place;
      } else if (!isMeant(place, pin.line)) {
        wrong.push_back(textOf(place, own));
      }
    }
    if (arrived == nullptr && wrong.empty()) {
      return say(false,
                 fmt::format("{} doesn't reach {}: its wire is broken, or it is another line",
                             begin, wanted));
    }
    if (arrived == nullptr) {
      return say(false,
                 fmt::format("{} reaches {} instead of {}: {}", begin, listText(wrong, "and"),
                             wanted, "exchange the wires, or the lines in the configuration"));
    }
    if (!wrong.empty()) {
      return say(false, fmt::format("{} reaches {}, but {} as well: two wires touch", begin, wanted,
                                    listText(wrong, "and")));
    }
    if (arrived->inverted != pin.inverted) {
      return say(false, fmt::format("{} reaches {} {}", begin, wanted,
                                    pin.inverted ? "directly: it isn't inverted, as configured"
                                                 : "inverted: set invert for it"));
    }
    say(true, fmt::format("{} reaches {}", begin, wanted));
  }

  const std::vector<config::AxisConfig>& axes_;
  gpio::Backend& backend_;
  std::vector<Chip> chips_;
  std::map<std::string, std::vector<int>> addresses_;  // by port
  std::map<std::string, std::unique_ptr<bus::RegisterPort>> ports_;
  std::vector<DriverFinding> findings_;
};

}  // namespace

std::vector<DriverFinding> checkDrivers(const std::vector<config::AxisConfig>& axes,
                                        gpio::Backend& backend, bool wiring) {
  return DriverCheck(axes, backend).run(wiring);
}

}  // namespace stepdriver::setup
