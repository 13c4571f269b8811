#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/sim/pin_trace.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::test {

inline constexpr double kTravel = 0.2;  // mm, of a full step of plainAxis()

/// An axis `x` with every pin that its chip has, without inversion, 0.2 mm for a full step, no
/// switches.
inline sim::RigAxisSpec plainAxis(const std::string& model, const std::string& name = "x") {
  const driver::DriverChip& chip = driver::driverChip(model);
  sim::RigAxisSpec spec;
  spec.name = name;
  spec.chip = chip;
  spec.step.line = name + ".step";
  spec.dir.line = name + ".dir";
  spec.enable.line = name + ".enable";
  if (!chip.modes.empty()) {
    spec.ms1.line = name + ".ms1";
    spec.ms2.line = name + ".ms2";
    spec.ms3.line = name + ".ms3";
  }
  if (chip.sleep_asleep) spec.sleep.line = name + ".sleep";
  if (chip.reset_held) spec.reset.line = name + ".reset";
  spec.full_step_travel = 0.2;
  return spec;
}

using Violations = std::map<sim::Violation, std::int64_t>;

/// In words, for messages.
inline std::string inWords(const Violations& violations) {
  std::string text;
  for (const auto& [kind, count] : violations) {
    text += (text.empty() ? "" : ", ") + std::to_string(count) + " x " + sim::nameOf(kind);
  }
  return text.empty() ? "none" : text;
}

/// A rig whose edges are made by hand. Time advances only if the test says so.
struct HandRig {
  explicit HandRig(const std::vector<sim::RigAxisSpec>& specs,
                   const std::vector<sim::RigCoupling>& couplings = {})
      : trace(std::make_shared<sim::MemoryTrace>()), rig(specs, trace, couplings) {}
  explicit HandRig(const sim::RigAxisSpec& spec) : HandRig(std::vector<sim::RigAxisSpec>{spec}) {}
  explicit HandRig(const std::string& model) : HandRig(plainAxis(model)) {}

  /// Requests all lines of an axis so that it can make full steps, and waits until it is ready.
  HandRig& ready(const std::string& axis = "x") {
    request(axis + ".step", false);
    request(axis + ".dir", true);
    for (const char* pin : {".ms1", ".ms2", ".ms3"}) request(axis + pin, false);
    request(axis + ".sleep", true);
    request(axis + ".reset", true);
    request(axis + ".enable", false);
    return wait(1'000'000'000);
  }

  HandRig& request(const std::string& name, bool level) {
    rig.onRequest(line(name), level, now);
    return *this;
  }
  HandRig& set(const std::string& name, bool level) {
    rig.onEdge(line(name), level, now);
    return *this;
  }
  HandRig& wait(std::int64_t nanoseconds) {
    now += nanoseconds;
    return *this;
  }

  /// Pulses slow enough for every chip, including the low time of the last one.
  HandRig& pulse(int count = 1, const std::string& line = "x.step") {
    for (int i = 0; i < count; ++i) set(line, true).wait(kHalf).set(line, false).wait(kHalf);
    return *this;
  }
  HandRig& direction(bool forward) { return wait(kHalf).set("x.dir", forward).wait(kHalf); }

  int line(const std::string& name) { return rig.lineIndex(name); }
  bool reads(const std::string& name) { return rig.inputLevel(line(name), now); }
  sim::RigAxisReport report(const std::string& axis = "x") const { return rig.report(axis); }

  static constexpr std::int64_t kHalf = 10'000;
  std::int64_t now = 1'000'000;
  std::shared_ptr<sim::MemoryTrace> trace;
  sim::Rig rig;
};

}  // namespace stepdriver::test
