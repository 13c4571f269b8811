#include "hardware/line_record.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <system_error>
#include <vector>

namespace stepdriver::node_test {
namespace {

constexpr const char* kTracing = "/sys/kernel/tracing";

}  // namespace

LineRecord::LineRecord() : folder_(std::string(kTracing) + "/instances/node_test") {
  std::filesystem::create_directory(folder_);
  test::writeText(folder_ + "/trace_clock", "mono");
  test::writeText(folder_ + "/buffer_size_kb", "16384");
  test::writeText(folder_ + "/events/gpio/gpio_value/enable", "1");
}

LineRecord::~LineRecord() {
  std::error_code ignored;
  std::filesystem::remove(folder_, ignored);
}

kernel::KernelTrace LineRecord::read() const {
  return kernel::KernelTrace::fromFile(folder_ + "/trace");
}

kernel::KernelTrace LineRecord::sinceBoot() {
  return kernel::KernelTrace::fromFile(std::string(kTracing) + "/trace");
}

unsigned numberOf(const test::GpioSimLines& chip, unsigned offset) {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/gpio")) {
    const std::string folder = entry.path();
    std::error_code error;
    if (!std::filesystem::exists(folder + "/label", error)) continue;
    if (test::readText(folder + "/label") != chip.label()) continue;
    return static_cast<unsigned>(std::stoul(test::readText(folder + "/base"))) + offset;
  }
  throw std::runtime_error("the kernel has no numbers for the lines of " + chip.label());
}

std::int64_t pulsesIn(const kernel::KernelTrace& trace, const StepAndDir& lines) {
  std::int64_t pulses = 0;
  bool step = false;
  bool dir = false;
  for (const kernel::LineEvent& event : trace.events()) {
    if (event.line == lines.dir) dir = event.level;
    if (event.line != lines.step) continue;
    if (event.level && !step) pulses += dir ? 1 : -1;
    step = event.level;
  }
  return pulses;
}

std::vector<std::int64_t> timesSet(const kernel::KernelTrace& trace, unsigned line, bool level) {
  std::vector<std::int64_t> times;
  for (const kernel::LineEvent& event : trace.events()) {
    if (event.line == line && !event.read && event.level == level) times.push_back(event.time_ns);
  }
  return times;
}

bool lastSet(const kernel::KernelTrace& trace, unsigned line) {
  const auto& events = trace.events();
  for (auto event = events.rbegin(); event != events.rend(); ++event) {
    if (event->line == line && !event->read) return event->level;
  }
  throw std::runtime_error("line " + std::to_string(line) + " was never set");
}

int changesTogether(const kernel::KernelTrace& trace, unsigned one, unsigned other) {
  int together = 0;
  std::set<unsigned> named;  // in the write under examination
  std::array<bool, 2> levels{};
  std::array<bool, 2> changed{};
  for (const kernel::LineEvent& event : trace.events()) {
    if (event.read) continue;
    if (!named.insert(event.line).second) {
      together += changed[0] && changed[1] ? 1 : 0;
      changed = {};
      named = {event.line};
    }
    for (const std::size_t i : {0U, 1U}) {
      if (event.line != (i == 0 ? one : other)) continue;
      changed[i] = event.level != levels[i];
      levels[i] = event.level;
    }
  }
  return together + (changed[0] && changed[1] ? 1 : 0);
}

}  // namespace stepdriver::node_test
