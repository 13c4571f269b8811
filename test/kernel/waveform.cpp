#include "waveform.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "sim/rotor_model.h"
#include "stepdriver_core/error.h"

namespace stepdriver::kernel {
namespace {

void keepShortest(std::optional<std::int64_t>& shortest, std::int64_t time) {
  shortest = std::min(shortest.value_or(time), time);
}

/// Follows the lines of one axis, event by event.
class Reader {
 public:
  explicit Reader(const WiredAxis& axis) : axis_(axis), chip_(axis.driver) {}

  void take(const LineEvent& event) {
    if (event.read) return;
    if (event.line == axis_.step.line) {
      takeStep(event.time_ns, chipLevel(axis_.step, event) == chip_.step_active);
    } else if (event.line == axis_.dir.line) {
      takeDir(event.time_ns, chipLevel(axis_.dir, event));
    } else if (axis_.enable && event.line == axis_.enable->line) {
      takeEnable(event.time_ns, chipLevel(*axis_.enable, event) == chip_.enable_on);
    }
  }

  Waveform finish() {
    const std::int64_t end = std::max(rose_.value_or(0), fell_.value_or(0));
    if (active_.value_or(false)) violate(Rule::kRest, end);
    return std::move(waveform_);
  }

 private:
  using Time = std::optional<std::int64_t>;  // no value: not yet

  static bool chipLevel(const WiredPin& pin, const LineEvent& event) {
    return event.level != pin.inverted;
  }

  void takeStep(std::int64_t now, bool active) {
    if (!active_) {
      if (active) violate(Rule::kRest, now);
    } else if (*active_ != active) {
      ++waveform_.edges;
      active ? rise(now) : fall(now);
    }
    active_ = active;
  }

  void rise(std::int64_t now) {
    check(Rule::kStepLow, fell_, now, chip_.timing.step_low_ns, waveform_.shortest.low);
    check(Rule::kInterval, rose_, now, axis_.shortest_interval_ns, waveform_.shortest.interval);
    checkOneWrite(turned_, now);
    if (forward_) {
      check(Rule::kDirSetup, dir_set_, now, chip_.timing.dir_setup_ns,
            waveform_.shortest.dir_setup);
    } else {
      violate(Rule::kDirSetup, now, 0, chip_.timing.dir_setup_ns);
    }
    checkEnabled(now);
    rose_ = now;
    waveform_.pulses.push_back({now, forward_.value_or(false)});
  }

  void fall(std::int64_t now) {
    check(Rule::kStepHigh, rose_, now, chip_.timing.step_high_ns, waveform_.shortest.high);
    fell_ = now;
  }

  void takeDir(std::int64_t now, bool forward) {
    if (forward_ == forward) return;
    if (forward_) {
      ++waveform_.edges;
      turned_ = now;
      checkOneWrite(rose_, now);
      check(Rule::kDirHold, rose_, now, chip_.timing.dir_hold_ns, waveform_.shortest.dir_hold);
    }
    forward_ = forward;
    dir_set_ = now;
  }

  void takeEnable(std::int64_t now, bool enabled) {
    if (enabled_ == enabled) return;
    if (enabled_) ++waveform_.edges;
    enabled_ = enabled;
    enable_set_ = now;
  }

  void checkEnabled(std::int64_t now) {
    if (!axis_.enable) return;
    if (!enabled_.value_or(false)) {
      violate(Rule::kEnabled, now);
    } else if (now - *enable_set_ < chip_.timing.enable_ns) {
      violate(Rule::kEnableTime, now, now - *enable_set_, chip_.timing.enable_ns);
    }
  }

  void checkOneWrite(const Time& other, std::int64_t now) {
    if (other && now - *other <= axis_.one_write_ns) {
      violate(Rule::kOneWrite, now, now - *other, axis_.one_write_ns + 1);
    }
  }

  void check(Rule rule, const Time& since, std::int64_t now, std::int64_t least, Time& shortest) {
    if (!since) return;
    const std::int64_t time = now - *since;
    keepShortest(shortest, time);
    if (time < least) violate(rule, now, time, least);
  }

  void violate(Rule rule, std::int64_t now, std::int64_t seen = 0, std::int64_t least = 0) {
    waveform_.violations.push_back({rule, now, seen, least});
  }

  const WiredAxis& axis_;
  const driver::DriverChip& chip_;
  Waveform waveform_;
  // Levels have no value before the line is requested.
  std::optional<bool> active_;
  std::optional<bool> forward_;
  std::optional<bool> enabled_;
  Time rose_;
  Time fell_;
  Time turned_;  // time of its last change, without the request, which dir_set_ includes
  Time dir_set_;
  Time enable_set_;
};

void refuseSilent(const KernelTrace& trace, const WiredPin& pin, const char* name) {
  if (trace.firstLevel(pin.line)) return;
  throw Error("Nothing happened to line " + std::to_string(pin.line) + " (" + name + ").");
}

std::string inMicroseconds(const std::optional<std::int64_t>& time) {
  if (!time) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), "%.3f us", static_cast<double>(*time) * 1e-3);
  return text;
}

std::string textOf(const Violation& violation) {
  char text[128];
  std::snprintf(text, sizeof(text), "at %.9f s", static_cast<double>(violation.time_ns) * 1e-9);
  std::string whole = text;
  if (violation.least_ns > 0) {
    whole += ": " + inMicroseconds(violation.seen_ns) + ", and at least " +
             inMicroseconds(violation.least_ns) + " is right";
  }
  return whole;
}

}  // namespace

WiredAxis wiredAxis(const config::AxisConfig& config, const KernelTrace& trace) {
  const auto wired = [&trace](const config::Pin& pin) {
    return WiredPin{trace.line(pin.line), pin.inverted};
  };
  WiredAxis axis;
  axis.driver = config.driver;
  axis.step = wired(config.pins.step);
  axis.dir = wired(config.pins.dir);
  if (config.pins.enable.wired()) axis.enable = wired(config.pins.enable);
  return axis;
}

const char* nameOf(Rule rule) {
  switch (rule) {
    case Rule::kStepHigh:
      return "STEP high time";
    case Rule::kStepLow:
      return "STEP low time";
    case Rule::kDirSetup:
      return "DIR setup before STEP";
    case Rule::kDirHold:
      return "DIR hold after STEP";
    case Rule::kOneWrite:
      return "STEP and DIR in one write";
    case Rule::kEnabled:
      return "STEP while not enabled";
    case Rule::kEnableTime:
      return "STEP too soon after ENABLE";
    case Rule::kInterval:
      return "interval shorter than planned";
    case Rule::kRest:
      return "STEP active at rest";
  }
  return "unknown rule";
}

std::int64_t Waveform::forward() const {
  return std::count_if(pulses.begin(), pulses.end(), [](const Pulse& p) { return p.forward; });
}

std::int64_t Waveform::backward() const {
  return static_cast<std::int64_t>(pulses.size()) - forward();
}

std::map<Rule, std::size_t> Waveform::violationsByRule() const {
  std::map<Rule, std::size_t> counts;
  for (const Violation& violation : violations) ++counts[violation.rule];
  return counts;
}

Waveform waveformOf(const KernelTrace& trace, const WiredAxis& axis) {
  refuseSilent(trace, axis.step, "STEP");
  refuseSilent(trace, axis.dir, "DIR");
  if (axis.enable) refuseSilent(trace, *axis.enable, "ENABLE");
  Reader reader(axis);
  for (const LineEvent& event : trace.events()) reader.take(event);
  return reader.finish();
}

MotorView motorViewOf(const std::vector<Pulse>& pulses, int microsteps) {
  constexpr std::int64_t kAfterwards = 1'000'000'000;
  if (pulses.empty()) return {};
  sim::MotorSpec motor;
  motor.damping = 0.05;
  sim::RotorModel rotor(motor);
  rotor.rest(pulses.front().time_ns);
  for (const Pulse& pulse : pulses) {
    rotor.turnTo(pulse.time_ns);
    rotor.moveField((pulse.forward ? 0.5 : -0.5) * sim::kPi / microsteps);
  }
  rotor.turnTo(pulses.back().time_ns + kAfterwards);
  return {rotor.largestLag() * 180.0 / sim::kPi, 4 * rotor.slips()};
}

std::string reportOf(const Waveform& waveform) {
  const ShortestTimes& shortest = waveform.shortest;
  std::string text = "  edges read from the kernel: " + std::to_string(waveform.edges) +
                     "\n  pulses: " + std::to_string(waveform.forward()) + " forward, " +
                     std::to_string(waveform.backward()) + " backward; position " +
                     std::to_string(waveform.position()) + "\n  shortest: STEP high " +
                     inMicroseconds(shortest.high) + ", low " + inMicroseconds(shortest.low) +
                     ", interval " + inMicroseconds(shortest.interval) + "; DIR setup " +
                     inMicroseconds(shortest.dir_setup) + ", hold " +
                     inMicroseconds(shortest.dir_hold) +
                     "\n  violations: " + std::to_string(waveform.violations.size()) + "\n";
  for (const auto& [broken, count] : waveform.violationsByRule()) {
    const Rule rule = broken;
    const auto first = std::find_if(waveform.violations.begin(), waveform.violations.end(),
                                    [rule](const Violation& v) { return v.rule == rule; });
    text +=
        "    " + std::to_string(count) + " x " + nameOf(rule) + ", first " + textOf(*first) + "\n";
  }
  return text;
}

}  // namespace stepdriver::kernel
