#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernel_trace.h"
#include "point_to_point/planner.h"
#include "profile/step_finder.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/pulse/clock.h"
#include "support/gpio_sim.h"
#include "waveform.h"

/// Shared by the tests of whole machines on the test kernel.
namespace stepdriver::kernel {

/// Whether this kernel's time is virtual: `run.sh --time-travel`.
bool timeTravels();

/// Why a test that needs gpio-sim and virtual time can't run; empty: it can.
std::string missingVirtualTime();

/// The duration of a read of the clock in virtual time [ns]. That kernel also reads it for each
/// event of a trace.
constexpr std::int64_t kClockRead = 256;

/// The guard of the clock in virtual time, where a sleep is exact, and each read of the clock while
/// spinning is a system call.
constexpr pulse::Nanoseconds kExactGuard = 2'000;

/// Records the kernel's gpio tracepoints from now on. Only one recording is possible at a time.
class Recording {
 public:
  Recording();

  /// Ends the recording. If the environment variable STEPDRIVER_TRACES names a folder, the trace is
  /// kept there.
  /// @param name of the file in that folder.
  KernelTrace stop(const std::string& name);
};

/// The wiring of an axis: lines as label:offset, which may invert the level.
struct Place {
  config::Pin step, dir, enable;
};

/// A linear axis of 80 microsteps/mm with 2000 microsteps/s and 10,000 microsteps/s^2, enabled on
/// start, and without switches.
config::AxisConfig axisAt(const std::string& name, const std::string& model, const Place& place);

/// A machine with a pulse thread on the lines of two chips of the kernel's gpio-sim, board-0 and
/// board-1. A late pulse is never a fault here, because the machine may stall. It records its last
/// minute.
class KernelBench {
 public:
  /// @param guard of the clock (pulse::SteadyClock).
  explicit KernelBench(const std::vector<config::AxisConfig>& axes,
                       pulse::Nanoseconds guard = 60'000);
  /// @param options of the machine; its lateness and its recording are those of the other machines.
  KernelBench(const std::vector<config::AxisConfig>& axes, machine::MachineOptions options,
              pulse::Nanoseconds guard = 60'000);

  machine::Machine& machine() { return *machine_; }
  axis::Axis& axis(const std::string& name) { return machine_->axis(name); }
  test::GpioSimChip& chip(std::size_t index) { return chips_.at(index); }

  /// The position that the axis reports [microsteps].
  std::int64_t count(const std::string& name);

  /// Starts a relative move, in microsteps.
  axis::Move start(const std::string& name, std::int64_t steps);

  /// Returns when the axis is this many microsteps from 0, in either direction, or at rest.
  void awaitCount(const std::string& name, std::int64_t steps);

  /// @return whether the line gets this level within ten seconds.
  bool awaitLevel(std::size_t chip, unsigned offset, bool level);

  void emergencyStop() { machine_->emergencyStop(); }
  void recover() { machine_->recover(); }
  machine::EngineFigures figures() const { return machine_->figures(); }

  /// Shuts the machine down and releases its lines.
  /// @return what the kernel did to the lines since they were requested.
  KernelTrace finish(const std::string& name);

 private:
  std::array<test::GpioSimChip, 2> chips_{{{"bench0", "board-0", 8}, {"bench1", "board-1", 8}}};
  pulse::SteadyClock clock_;
  std::unique_ptr<gpio::Backend> backend_;
  Recording recording_;
  std::unique_ptr<machine::Machine> machine_;
};

/// The limits of axisAt(), in microsteps.
motion::MotionLimits limitsOf(const config::AxisConfig& config);

/// The steps of a move, in nanoseconds after its start.
std::vector<motion::Step> plannedSteps(std::int64_t from, std::int64_t to,
                                       const motion::MotionLimits& limits);

}  // namespace stepdriver::kernel
