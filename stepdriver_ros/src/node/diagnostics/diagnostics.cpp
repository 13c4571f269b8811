#include "diagnostics.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <utility>

#include "axis_diagnostics.h"
#include "engine_diagnostics.h"
#include "named_lines_diagnostics.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::ros_node {
namespace {

const ros::WallDuration kReportPeriod(1.0);
constexpr const char* kEngineName = "pulse engine";
constexpr const char* kMasterName = "ROS master";
constexpr const char* kNamedLinesName = "named lines";
constexpr const char* kStateFileName = "state file";
constexpr const char* kRecorderName = "flight recorder";

/// For the current limits, and for the current motions.
void readRates(const machine::Machine& machine, EngineReading& reading) {
  if (!machine.capability()) return;
  std::vector<config::AxisConfig> axes;
  std::vector<double> rates;
  for (const auto& axis : machine.axes()) {
    axes.push_back(axis->config());
    axes.back().max_speed = axis->limits().max_speed;
    rates.push_back(axis->peakRate());
  }
  reading.rates = machine::stepRates(axes, *machine.capability()).axes;
  reading.rates_in_motion = machine::stepRatesInMotion(axes, *machine.capability(), rates).axes;
}

}  // namespace

Diagnostics::Diagnostics(ros::NodeHandle node, const ros::NodeHandle& private_node,
                         const machine::Machine& machine, CallQueues& queues,
                         const MasterWatch& master, const std::string& hardware_id,
                         const NodeConfig& config, const FlightRecorderService& recorder)
    : machine_(machine),
      master_(master),
      recorder_(recorder),
      max_lateness_(config.max_lateness),
      state_file_(config.state_file),
      updater_(node, private_node) {
  updater_.setHardwareID(hardware_id);
  for (const auto& axis : machine.axes()) {
    updater_.add(axis->config().name, [&axis](Status& status) { fillAxisStatus(*axis, status); });
  }
  updater_.add(kEngineName, [this](Status& status) { fillEngineStatus(status); });
  updater_.add(kMasterName, [this](Status& status) { fillMasterStatus(status); });
  if (!config.outputs.empty() || !config.inputs.empty()) {
    updater_.add(kNamedLinesName,
                 [this](Status& status) { reportNamedLines(machine_.ioStates(), status); });
  }
  if (!state_file_.empty()) {
    updater_.add(kStateFileName, [this](Status& status) { fillStateFileStatus(status); });
  }
  if (config.recorder.seconds > 0.0) {
    updater_.add(kRecorderName, [this](Status& status) { fillRecorderStatus(status); });
  }
  node.setCallbackQueue(&queues.control());
  timer_ = node.createSteadyTimer(
      kReportPeriod, [this](const ros::SteadyTimerEvent& /*event*/) { updater_.force_update(); },
      false);
}

void Diagnostics::fillAxisStatus(const axis::Axis& axis, Status& status) {
  AxisReading reading;
  reading.state = axis.state();
  reading.limits = axis.limits();
  try {
    reading.endstops = axis.endstops();
  } catch (const GpioError& error) {
    reading.endstop_error = error.what();
  }
  reportAxis(axis.config(), reading, status);
}

void Diagnostics::fillEngineStatus(Status& status) {
  EngineReading reading;
  reading.figures = machine_.figures();
  reading.slips_before = slips_before_;
  reading.max_lateness = max_lateness_;
  readRates(machine_, reading);
  slips_before_ = reading.figures.slips;
  reportEngine(reading, status);
}

void Diagnostics::fillMasterStatus(Status& status) const {
  const MasterWatch::Reading reading = master_.reading();
  if (reading.silent > 0.0) {
    status.summary(Status::ERROR, "doesn't answer: no new client can find this node");
  } else {
    status.summary(Status::OK, "knows this node");
  }
  status.add("URI", reading.uri);
  status.add("silent [s]", fmt::format("{:.0f}", reading.silent));
  status.add("times registered again", reading.restarts);
}

void Diagnostics::fillStateFileStatus(Status& status) const {
  const std::string error = machine_.stateFileError();
  if (error.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "written");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, error);
  }
  status.add("file", state_file_);
}

void Diagnostics::fillRecorderStatus(Status& status) const {
  const std::string error = recorder_.error();
  if (error.empty()) {
    status.summary(Status::OK, "records");
  } else {
    status.summary(Status::WARN, error);
  }
  const recorder::Dump last = recorder_.last();
  status.add("last recording", last.trace);
  status.add("its reason", last.reason);
  status.add("at top speed it keeps [s]", fmt::format("{:.3g}", machine_.recordedSeconds()));
}

std::string hardwareId(const std::vector<config::AxisConfig>& axes, const std::string& on) {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  std::string text = std::string(host.data()) + ": ";
  for (const config::AxisConfig& axis : axes) {
    text += fmt::format("{} {}, ", axis.name, axis.driverTitles());
  }
  return text + "on " + on;
}

}  // namespace stepdriver::ros_node
