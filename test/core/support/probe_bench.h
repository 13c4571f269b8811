#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"

namespace stepdriver::test {

/// A probe on the rig, which is pressed between two places of its axis [mm]. It bounces for 0.1 ms
/// each time.
inline sim::SwitchSpec probeSwitch(double from, double to, double hysteresis, int bounces) {
  sim::SwitchSpec probe;
  probe.line = "io.probe";
  probe.active_level = true;
  probe.position = from;
  probe.end = to;
  probe.hysteresis = hysteresis;
  probe.bounces = bounces;
  probe.bounce_ns = 100'000;
  return probe;
}

/// The options of a machine whose input "probe" is that switch.
inline machine::MachineOptions probeOptions(std::int64_t debounce_ns) {
  machine::MachineOptions options;
  config::InputConfig input;
  input.name = "probe";
  input.line = {"io.probe", true, Bias::kAsIs};
  input.debounce_ns = debounce_ns;
  options.inputs.push_back(input);
  return options;
}

/// How a probing comes to its contact.
struct ProbeWay {
  bool towards_max = true;
  bool away = false;      ///< the contact is where the input becomes inactive
  double backlash = 0.0;  ///< [m] of both axes; that of the rig is 0
  bool with_y = false;    ///< along a line of x and y

  double sign() const { return towards_max ? 1.0 : -1.0; }
  std::string text() const {
    return std::string(towards_max ? "towards max" : "towards min") + (away ? ", away" : "") +
           (backlash > 0.0 ? ", with a backlash" : "") + (with_y ? ", with y" : "");
  }
};

/// All of them.
inline std::vector<ProbeWay> probeWays() {
  std::vector<ProbeWay> ways;
  for (const bool towards_max : {true, false}) {
    for (const bool away : {false, true}) {
      for (const double backlash : {0.0, 0.0005}) {
        for (const bool with_y : {false, true}) {
          ways.push_back({towards_max, away, backlash, with_y});
        }
      }
    }
  }
  return ways;
}

/// The axes x and y on the rig, at 0 of which the positions are 0. Only x meets the probe, and its
/// endstops.
class ProbeBench {
 public:
  struct Rig {
    double contact = 20.0;    ///< [mm] from 0, in the direction of the probing
    double endstop = 100.0;   ///< [mm] the same
    double hysteresis = 0.0;  ///< [mm] of the probe
    int bounces = 0;          ///< of the probe, 0.1 ms each
    std::int64_t debounce_ns = 0;
    /// [m] Soft limits of x in the direction of the probing.
    std::optional<double> limit_behind = {};
    std::optional<double> limit_ahead = {};
  };

  ProbeBench(const ProbeWay& way, const Rig& rig) : way_(way) {
    std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y")};
    for (config::AxisConfig& axis : axes) axis.backlash = way.backlash;
    const auto limit = [&way](const std::optional<double>& ahead) {
      return ahead ? std::optional<double>(way.sign() * *ahead) : std::nullopt;
    };
    axes[0].min_position = limit(way.towards_max ? rig.limit_behind : rig.limit_ahead);
    axes[0].max_position = limit(way.towards_max ? rig.limit_ahead : rig.limit_behind);
    axes[0].homing.emplace().kind = config::HomingKind::kDirect;
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    specs[0].max_switch->position = rig.endstop;
    specs[0].min_switch->position = -rig.endstop;
    const double from = way.sign() * (way.away ? -60.0 : rig.contact);
    const double to = way.sign() * (way.away ? rig.contact : rig.contact + 60.0);
    specs[0].flags.push_back(
        probeSwitch(std::min(from, to), std::max(from, to), rig.hysteresis, rig.bounces));
    bench_ = std::make_unique<Bench>(axes, specs, false, 0.0, probeOptions(rig.debounce_ns));
    bench_->axis("y").setPosition(0.0);
    // Nothing but a homing leaves an axis beyond its limits.
    bench_->axis().home();
  }

  /// A probing over so many metres in its direction, at 20 mm/s. y goes half as far.
  machine::ProbeRequest over(double distance) const {
    machine::ProbeRequest request;
    request.input = "probe";
    request.names = {"x"};
    request.positions = {way_.sign() * distance};
    if (way_.with_y) {
      request.names.emplace_back("y");
      request.positions.push_back(-0.5 * request.positions.front());
    }
    request.away = way_.away;
    request.velocity = 0.02;
    return request;
  }

  /// [m] How far an axis has come in the direction of the probing, by its pulses.
  double reached(const std::string& name = "x") {
    return way_.sign() * static_cast<double>(bench_->pulses(name)) * kStep;
  }

  /// [steps] Where the joint of an axis was at a time, by the rig's trace.
  double jointAt(const std::string& name, std::int64_t time_ns) const {
    const int step = bench_->trace->pin(name, "step");
    const int dir = bench_->trace->pin(name, "dir");
    const double play = std::round(way_.backlash / kStep);
    bool forward = bench_->trace->levels()[static_cast<std::size_t>(dir)];
    double count = 0.0;
    double slack = 0.0;
    for (const sim::MemoryTrace::Edge& edge : bench_->trace->edges()) {
      if (edge.time_ns > time_ns) break;
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      count += forward ? 1.0 : -1.0;
      slack = std::clamp(slack + (forward ? 1.0 : -1.0), 0.0, play);
    }
    return count - slack;
  }

  /// The times at which contacts began: of the bounces of a switch only the first edge.
  std::vector<std::int64_t> contacts() const {
    constexpr std::int64_t kBouncesEnd = 5'000'000;
    const int probe = bench_->trace->pin("x", "flag1");
    std::vector<std::int64_t> times;
    std::int64_t latest = std::numeric_limits<std::int64_t>::min() / 2;
    for (const sim::MemoryTrace::Edge& edge : bench_->trace->edges()) {
      if (edge.pin != probe) continue;
      const bool begins = edge.time_ns - latest > kBouncesEnd;
      if (begins && edge.level != way_.away) times.push_back(edge.time_ns);
      latest = edge.time_ns;
    }
    return times;
  }

  Bench& operator*() const { return *bench_; }
  Bench* operator->() const { return bench_.get(); }

 private:
  ProbeWay way_;
  std::unique_ptr<Bench> bench_;
};

}  // namespace stepdriver::test
