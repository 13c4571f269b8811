#pragma once

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/sim/pin_trace.h"
#include "support/half_steps.h"

namespace stepdriver::search {

/// What all edges of some runs were, in one number (FNV-1a): it tells whether a change has moved
/// any of them.
class EdgeHash {
 public:
  void add(std::uint64_t value) {
    for (int byte = 0; byte < 8; ++byte, value >>= 8U) {
      hash_ = (hash_ ^ (value & 0xFFU)) * 0x100000001B3U;
    }
    ++values_;
  }
  std::string text() const { return fmt::format("{} values, hash {:016x}", values_, hash_); }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325U;
  std::uint64_t values_ = 0;
};

/// Reports each step of the rig, with the number of its axis, and counts them: a rising edge of
/// STEP, or another pattern of coils. The chips are A4988s, or have registers, or switch coils.
class RiseWatch : public sim::PinTrace {
 public:
  explicit RiseWatch(std::vector<std::string> axes) : axes_(std::move(axes)) {
    motors_.resize(axes_.size());
  }

  std::function<void(std::size_t axis, std::int64_t time_ns)> rose;
  EdgeHash* hash = nullptr;  ///< is given all edges

  /// [1/16 steps, half steps of coils] Where the pulses have taken the motor of an axis.
  std::int64_t place(std::size_t axis) const { return motors_.at(axis).place; }
  /// The mode of a chip with registers.
  void setMicrosteps(std::size_t axis, int microsteps) { motors_.at(axis).step = 16 / microsteps; }

  /// The axis has a motor of phases, in half steps.
  void hasPhases(std::size_t axis) {
    motors_.at(axis).has_phases = true;
    motors_.at(axis).pattern = test::halfStepOf(motors_.at(axis).coils);
  }
  /// A write is over. What it has done to coils counts as one.
  void settle() {
    for (std::size_t axis = 0; axis < motors_.size(); ++axis) {
      if (motors_[axis].is_switching) settle(axis);
    }
  }

  void begin(const std::vector<sim::TracePin>& pins, const std::vector<bool>& levels,
             std::int64_t /*time_ns*/) override {
    pins_.assign(pins.size(), {});
    for (std::size_t i = 0; i < pins.size(); ++i) {
      for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
        if (pins[i].scope == axes_[axis]) pins_[i] = {axis, roleOf(pins[i].variable)};
      }
      if (pins_[i].role == Role::kDir) motors_[pins_[i].axis].forward = *pins[i].active;
      if (pins_[i].role != Role::kOther) set(pins_[i], levels[i]);
    }
  }

  void edge(int pin, bool level, std::int64_t time_ns) override {
    if (hash != nullptr) {
      hash->add(static_cast<std::uint64_t>(time_ns));
      hash->add(static_cast<std::uint64_t>(2 * pin + (level ? 1 : 0)));
    }
    const Pin& changed = pins_[static_cast<std::size_t>(pin)];
    if (changed.role == Role::kOther) return;
    if (changed.role >= Role::kIn1) return switchCoil(changed, level, time_ns);
    if (changed.role != Role::kStep) return set(changed, level);
    if (!level) return;
    Motor& motor = motors_[changed.axis];
    motor.place += motor.dir == motor.forward ? motor.step : -motor.step;
    if (rose) rose(changed.axis, time_ns);
  }

 private:
  enum class Role { kOther, kStep, kDir, kMs1, kMs2, kMs3, kIn1, kIn2, kIn3, kIn4 };
  struct Pin {
    std::size_t axis = 0;
    Role role = Role::kOther;
  };
  struct Motor {
    bool dir = false;
    bool forward = true;  // the level of DIR
    driver::ModeCode code{};
    std::int64_t step = 16;
    std::int64_t place = 0;
    bool has_phases = false;
    test::Coils coils{};
    std::optional<int> pattern;  // the last one that a step has; empty: none so far
    bool is_switching = false;
    std::int64_t switched_ns = 0;
  };

  static Role roleOf(const std::string& variable) {
    if (variable == "step") return Role::kStep;
    if (variable == "dir") return Role::kDir;
    if (variable == "ms1") return Role::kMs1;
    if (variable == "ms2") return Role::kMs2;
    if (variable == "ms3") return Role::kMs3;
    if (variable == "in1") return Role::kIn1;
    if (variable == "in2") return Role::kIn2;
    if (variable == "in3") return Role::kIn3;
    return variable == "in4" ? Role::kIn4 : Role::kOther;
  }

  void switchCoil(const Pin& pin, bool level, std::int64_t time_ns) {
    Motor& motor = motors_[pin.axis];
    if (motor.is_switching && time_ns > motor.switched_ns) settle(pin.axis);
    set(pin, level);
    motor.is_switching = true;
    motor.switched_ns = time_ns;
  }

  void settle(std::size_t axis) {
    Motor& motor = motors_[axis];
    motor.is_switching = false;
    const std::optional<int> now = test::halfStepOf(motor.coils);
    if (!now || !motor.has_phases) return;
    const int way = test::wayBetween(std::exchange(motor.pattern, now).value_or(*now), *now);
    motor.place += way;
    if (way != 0 && rose) rose(axis, motor.switched_ns);
  }

  void set(const Pin& pin, bool level) {
    Motor& motor = motors_[pin.axis];
    if (pin.role == Role::kDir) motor.dir = level;
    if (pin.role < Role::kMs1) return;
    if (pin.role >= Role::kIn1) {
      motor.coils.at(static_cast<std::size_t>(pin.role) - static_cast<std::size_t>(Role::kIn1)) =
          level;
      return;
    }
    motor.code.at(static_cast<std::size_t>(pin.role) - static_cast<std::size_t>(Role::kMs1)) =
        level;
    static const driver::DriverChip& chip = driver::driverChip("a4988");
    motor.step = 16 / driver::microstepsOf(chip, motor.code).value_or(16);
  }

  const std::vector<std::string> axes_;
  std::vector<Pin> pins_;
  std::vector<Motor> motors_;
};

}  // namespace stepdriver::search
