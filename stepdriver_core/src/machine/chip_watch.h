#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "activity/context.h"
#include "axis/axis_model.h"
#include "bus/register_job.h"
#include "motor/tmc_chip.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// What helps after a driver chip's report of a fault whose cause isn't known.
constexpr const char* kChipRemedy =
    "let it cool down, check the motor's wiring and the current that is set, then call recover";

/// Asks driver chips with registers how they are: four times a second, more often for their load
/// while they move, and their microstep counter at rest. What they need without a request, such as
/// the current of an idle motor, is written to them.
class ChipWatch {
 public:
  using IsHoming = std::function<bool(const axis::AxisModel&)>;
  using Fail =
      std::function<void(axis::AxisModel&, const std::string& fault, const std::string& remedy)>;

  /// @param context outlives it.
  /// @param is_homing whether an axis is being homed.
  /// @param fail is told of an axis whose chip is at fault.
  ChipWatch(activity::Context& context, IsHoming is_homing, Fail fail);

  /// Something may have happened to an axis.
  void supervise(axis::AxisModel& axis);
  /// Clock time by which supervise() must be called.
  pulse::Nanoseconds due() const;

  /// A chip has reported a fault on its output: its registers tell the cause.
  void askForCause(axis::AxisModel& axis, std::size_t motor);

  /// Accesses that this has asked for have ended; others are left alone.
  void take(const bus::RegisterDone& done);
  /// A request's change of a register has ended. @return why it failed; empty: it didn't.
  std::string takeSetting(axis::AxisModel& axis, std::size_t motor, const bus::RegisterDone& done);

 private:
  bool answers(const motor::TmcChip& chip) const;
  /// When a chip is asked how it is; kNever: not, for now.
  pulse::Nanoseconds pollDue(const motor::TmcChip& chip) const;
  /// The same for its load in motion.
  pulse::Nanoseconds sampleDue(const axis::AxisModel& axis, const motor::TmcChip& chip) const;
  void poll(axis::AxisModel& axis, std::size_t motor, bool rests);
  void sampleLoad(const axis::AxisModel& axis, motor::TmcChip& chip);
  void setIdleCurrent(const axis::AxisModel& axis, motor::TmcChip& chip);
  void endStall(const axis::AxisModel& axis, motor::TmcChip& chip);
  void takePoll(axis::AxisModel& axis, std::size_t motor, const bus::RegisterDone& done);
  void takeSample(axis::AxisModel& axis, std::size_t motor, const bus::RegisterDone& done);
  void nameCause(axis::AxisModel& axis, std::size_t motor, std::string fault);
  void fail(axis::AxisModel& axis, std::size_t motor, const std::string& fault);
  /// @return the number by which take() knows it.
  std::uint64_t order(bus::RegisterJob job);

  activity::Context& context_;
  const IsHoming is_homing_;
  const Fail fail_;
};

}  // namespace stepdriver::machine
