#include "kernel_bench.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>
#include <utility>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "support/test_board.h"

namespace stepdriver::kernel {
namespace {

void runGpioTrace(const std::string& arguments) {
  const std::string command = "bash '" STEPDRIVER_GPIO_TRACE "' " + arguments;
  if (std::system(command.c_str()) != 0) throw std::runtime_error(command + " failed");
}

machine::MachineOptions patient(machine::MachineOptions options) {
  options.max_lateness = 60.0;
  options.record_seconds = 60.0;
  return options;
}

}  // namespace

bool timeTravels() {
  std::ifstream file("/proc/cmdline");
  const std::string arguments{std::istreambuf_iterator<char>(file), {}};
  return arguments.find("time-travel") != std::string::npos;
}

std::string missingVirtualTime() {
  std::string board = test::gpioSimBoard().missing();
  if (!board.empty()) return board;
  return timeTravels() ? "" : "runs in virtual time (run.sh --time-travel)";
}

Recording::Recording() { runGpioTrace("start"); }

KernelTrace Recording::stop(const std::string& name) {
  const char* const kept = std::getenv("STEPDRIVER_TRACES");
  const std::string path = std::string(kept != nullptr ? kept : "/run") + "/" + name + ".trace";
  runGpioTrace("stop '" + path + "'");
  KernelTrace trace = KernelTrace::fromFile(path);
  if (kept == nullptr) std::filesystem::remove(path);
  return trace;
}

config::AxisConfig axisAt(const std::string& name, const std::string& model, const Place& place) {
  config::AxisConfig config;
  config.name = name;
  config.joint = name;
  config.driver = driver::driverChip(model);
  config.pins.step = place.step;
  config.pins.dir = place.dir;
  config.pins.enable = place.enable;
  config.microsteps = 16;
  config.steps_per_unit = 80'000.0;
  config.max_speed = 0.025;
  config.acceleration = 0.125;
  config.deceleration = 0.125;
  config.enable_on_start = true;
  return config;
}

KernelBench::KernelBench(const std::vector<config::AxisConfig>& axes, pulse::Nanoseconds guard)
    : KernelBench(axes, {}, guard) {}

KernelBench::KernelBench(const std::vector<config::AxisConfig>& axes,
                         machine::MachineOptions options, pulse::Nanoseconds guard)
    : clock_(guard),
      backend_(gpio::makeLibgpiodBackend()),
      machine_(std::make_unique<machine::Machine>(axes, *backend_, clock_,
                                                  patient(std::move(options)))) {}

std::int64_t KernelBench::count(const std::string& name) {
  const axis::Axis& of = machine_->axis(name);
  return std::llround(of.state().position * of.config().steps_per_unit);
}

axis::Move KernelBench::start(const std::string& name, std::int64_t steps) {
  axis::Axis& of = machine_->axis(name);
  return of.moveTo(static_cast<double>(steps) / of.config().steps_per_unit, true);
}

void KernelBench::awaitCount(const std::string& name, std::int64_t steps) {
  while (std::abs(count(name)) < steps && machine_->axis(name).state().moving) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

bool KernelBench::awaitLevel(std::size_t chip, unsigned offset, bool level) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (chips_.at(chip).level(offset) != level) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

KernelTrace KernelBench::finish(const std::string& name) {
  machine_.reset();
  return recording_.stop(name);
}

motion::MotionLimits limitsOf(const config::AxisConfig& config) {
  const double scale = config.steps_per_unit;
  return {config.start_speed * scale, config.max_speed * scale, config.acceleration * scale,
          config.deceleration * scale, config.jerk * scale};
}

std::vector<motion::Step> plannedSteps(std::int64_t from, std::int64_t to,
                                       const motion::MotionLimits& limits) {
  const motion::Profile profile =
      motion::planMove(0, {motion::fromInteger(from), 0.0, 0.0}, to, limits).profile;
  motion::StepFinder finder(profile, from);
  std::vector<motion::Step> steps;
  for (motion::Step step; finder.next(step);) steps.push_back(step);
  return steps;
}

}  // namespace stepdriver::kernel
