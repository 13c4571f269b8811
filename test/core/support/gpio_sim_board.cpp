#include <sys/mount.h>

#include <array>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <stdexcept>
#include <utility>

#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "support/gpio_sim.h"
#include "support/test_board.h"

namespace stepdriver::test {
namespace {

constexpr const char* kTracing = "/sys/kernel/tracing";

/// Records every level that the kernel sets an output to, from the kernel's own tracepoint. It has
/// its own buffer, so that another trace continues undisturbed.
class OutputTrace {
 public:
  OutputTrace() {
    namespace fs = std::filesystem;
    if (!fs::exists(std::string(kTracing) + "/instances")) {
      mount("tracefs", kTracing, "tracefs", 0, nullptr);
    }
    std::error_code failed;
    if (!fs::create_directory(folder_, failed)) return;
    there_ = fs::exists(folder_ + "/events/gpio/gpio_value/enable");
    if (there_) writeText(folder_ + "/events/gpio/gpio_value/enable", "1");
  }
  OutputTrace(const OutputTrace&) = delete;
  OutputTrace& operator=(const OutputTrace&) = delete;
  ~OutputTrace() {
    std::error_code ignored;
    std::filesystem::remove(folder_, ignored);
  }

  bool there() const { return there_; }

  /// The levels that were set since the last call, by the kernel's number of the line.
  std::vector<std::pair<int, bool>> take() {
    std::vector<std::pair<int, bool>> sets;
    std::ifstream trace(folder_ + "/trace");
    std::smatch match;
    for (std::string text; std::getline(trace, text);) {
      if (!std::regex_search(text, match, set_)) continue;
      sets.emplace_back(std::stoi(match[1]), match[2] == "1");
    }
    std::ofstream(folder_ + "/trace") << std::flush;  // opening it for writing empties it
    return sets;
  }

 private:
  const std::regex set_{" gpio_value: ([0-9]+) set ([01])"};
  const std::string folder_ = std::string(kTracing) + "/instances/gpio_sim_board";
  bool there_ = false;
};

class GpioSimTestBoard : public TestBoard {
 public:
  GpioSimTestBoard() {
    if (!trace_.there()) return;
    for (std::size_t chip = 0; chip < chips_.size(); ++chip) {
      const std::string first = line(static_cast<int>(chip), 0);
      backend_->request({{first, false, false}}, {}).reset();
      const auto sets = trace_.take();
      if (sets.empty()) throw std::runtime_error("the kernel's trace has nothing of " + first);
      for (unsigned offset = 0; offset < kLines; ++offset) {
        names_[sets.front().first + static_cast<int>(offset)] =
            line(static_cast<int>(chip), offset);
      }
    }
  }

  gpio::Backend& backend() override { return *backend_; }

  std::string line(int chip, unsigned offset) const override {
    return chips_[static_cast<std::size_t>(chip)].label() + ":" + std::to_string(offset);
  }

  bool level(const std::string& line) override {
    const auto [chip, offset] = placeOf(line);
    return chip->level(offset);
  }

  void drive(const std::string& line, bool level) override {
    const auto [chip, offset] = placeOf(line);
    chip->drive(offset, level);
  }

  std::int64_t pace() const override { return 25'000'000; }

  std::int64_t now() const override {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  }

  std::optional<std::vector<Driven>> takeDriven() override {
    if (!trace_.there()) return {};
    std::vector<Driven> driven;
    for (const auto& [number, level] : trace_.take()) {
      const auto known = levels_.find(number);
      if (known != levels_.end() && known->second == level) continue;
      levels_[number] = level;
      driven.push_back({names_.at(number), level});
    }
    return driven;
  }

 private:
  static constexpr unsigned kLines = 8;

  std::pair<GpioSimChip*, unsigned> placeOf(const std::string& line) {
    const auto colon = line.rfind(':');
    for (GpioSimChip& chip : chips_) {
      if (chip.label() != line.substr(0, colon)) continue;
      return {&chip, static_cast<unsigned>(std::stoi(line.substr(colon + 1)))};
    }
    throw std::runtime_error("no chip of this board has the line " + line);
  }

  std::array<GpioSimChip, 2> chips_{{{"board0", "board-0", kLines}, {"board1", "board-1", kLines}}};
  OutputTrace trace_;
  std::unique_ptr<gpio::Backend> backend_ = gpio::makeLibgpiodBackend();
  std::map<int, std::string> names_;  // by the kernel's number of the line
  std::map<int, bool> levels_;
};

std::string missing() {
  const char* const wanted = std::getenv("STEPDRIVER_GPIO_SIM");
  if (wanted == nullptr || std::string(wanted) != "1") {
    return "runs in the test kernel (test/kernel/run.sh with STEPDRIVER_GPIO_SIM=1)";
  }
  if (gpio::libgpiodVersion().empty()) return "stepdriver was built without libgpiod";
  if (!std::filesystem::is_directory(GpioSimLines::kFolder)) {
    return std::string("STEPDRIVER_GPIO_SIM is 1, but there is no ") + GpioSimLines::kFolder;
  }
  return "";
}

}  // namespace

TestBoardKind gpioSimBoard() {
  return {"Libgpiod", missing,
          []() -> std::unique_ptr<TestBoard> { return std::make_unique<GpioSimTestBoard>(); }};
}

}  // namespace stepdriver::test
