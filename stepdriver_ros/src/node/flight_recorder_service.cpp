#include "flight_recorder_service.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "common/text.h"
#include "node/services/respond.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/recording.h"

namespace stepdriver::ros_node {
namespace {

/// In the folder in which ROS keeps files of its nodes.
std::string defaultFolder() {
  for (const auto& [variable, below] :
       {std::pair{"ROS_HOME", "/stepdriver"}, std::pair{"HOME", "/.ros/stepdriver"}}) {
    const char* const folder = std::getenv(variable);
    if (folder != nullptr && folder[0] == '/') return std::string(folder) + below;
  }
  return "/tmp/stepdriver";
}

/// `/lab/stepdriver` becomes `lab_stepdriver`.
std::string fileNameOf(const std::string& node) {
  std::string name;
  for (const char c : node.substr(node.find_first_not_of('/'))) {
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  }
  return name;
}

}  // namespace

FlightRecorderService::FlightRecorderService(machine::Machine& machine,
                                             const setup::RecorderConfig& config,
                                             const std::string& node) {
  if (config.seconds <= 0.0) return;
  const double seconds = machine.recordedSeconds();
  if (seconds < config.seconds) {
    ROS_INFO_NAMED("recorder",
                   "At the top speeds of all axes the flight recorder keeps %s s instead of %s s: "
                   "that would take a recorder/memory_mb of %s",
                   roundedText(seconds).c_str(), roundedText(config.seconds).c_str(),
                   roundedText(1.001 * config.memory_mb * config.seconds / seconds).c_str());
  }
  recorder::DumperOptions options;
  options.folder = config.folder.empty() ? defaultFolder() : config.folder;
  options.name = fileNameOf(node);
  options.keep = config.keep;
  // A fault during the pause is written at its end, and must still be in the memory.
  options.fault_pause =
      std::chrono::milliseconds(std::llround(std::clamp(800.0 * seconds, 1'000.0, 10'000.0)));
  dumper_.emplace(machine, options, [this](const recorder::Dump& dump) { report(dump); });
}

void FlightRecorderService::report(const recorder::Dump& dump) {
  if (dump.error.empty()) {
    ROS_INFO_NAMED("recorder", "Recording (%s): %s and %s", dump.reason.c_str(), dump.trace.c_str(),
                   dump.events.c_str());
  } else if (!failed_) {
    ROS_ERROR_NAMED("recorder", "%s. The axes are not affected. /diagnostics says when it works",
                    dump.error.c_str());
  }
  failed_ = !dump.error.empty();
}

void FlightRecorderService::advertise(ros::NodeHandle node, CallQueues& queues) {
  using std_srvs::Trigger;
  const boost::function<bool(Trigger::Request&, Trigger::Response&)> handler =
      [this](Trigger::Request& /*request*/, Trigger::Response& response) {
        return respond(response, [&] {
          if (!dumper_) throw Refused(machine::kNothingRecorded);
          const recorder::Dump dump = dumper_->dump("the service dump");
          if (!dump.error.empty()) throw Error(dump.error);
          response.message = fmt::format("{} and {}", dump.trace, dump.events);
        });
      };
  node.setCallbackQueue(&queues.recordings());
  server_ = node.advertiseService("dump", handler);
}

void FlightRecorderService::request(const std::string& reason) {
  if (dumper_) {
    dumper_->request(reason);
  } else {
    ROS_WARN_NAMED("recorder", "No recording (%s): %s", reason.c_str(), machine::kNothingRecorded);
  }
}

}  // namespace stepdriver::ros_node
