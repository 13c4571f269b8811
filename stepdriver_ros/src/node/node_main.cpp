#include <fmt/format.h>
#include <pthread.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <ros/this_node.h>
#include <ros/time.h>

#include <boost/thread/exceptions.hpp>
#include <cstddef>
#include <cstdlib>
#include <deque>
#include <exception>
#include <functional>
#include <new>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "common/end_requests.h"
#include "common/latched_messages.h"
#include "common/loopback_only.h"
#include "common/master_directory.h"
#include "common/master_watch.h"
#include "common/node_config.h"
#include "common/node_start.h"
#include "node/actions/action_topics.h"
#include "node/actions/homing_action.h"
#include "node/actions/latching_action.h"
#include "node/actions/line_action.h"
#include "node/actions/move_actions.h"
#include "node/actions/path_action.h"
#include "node/actions/probing_action.h"
#include "node/actions/trajectory_action.h"
#include "node/calls/call_queues.h"
#include "node/diagnostics/diagnostics.h"
#include "node/flight_recorder_service.h"
#include "node/master/end_despite_master.h"
#include "node/parameters/read_parameters.h"
#include "node/services/axis_home_service.h"
#include "node/services/axis_services.h"
#include "node/services/machine_home_service.h"
#include "node/services/machine_services.h"
#include "node/systemd/service_manager.h"
#include "node/topics/clock_publisher.h"
#include "node/topics/io_publisher.h"
#include "node/topics/jog_subscriber.h"
#include "node/topics/output_subscriber.h"
#include "node/topics/setpoint_subscriber.h"
#include "node/topics/state_publisher.h"
#include "node/topics/trajectory_command.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/machine/step_rates.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::ros_node {
namespace {

constexpr int kExitGpio = 2;
constexpr int kExitTooSlow = 3;
constexpr int kExitStateFile = 4;
constexpr int kExitExhausted = 5;

constexpr std::chrono::milliseconds kPoll{1000};
// A simulator that is launched together with the node may take so long to publish its clock.
constexpr int kPollsUntilClock = 5;
// Time for the calls that arrived while the axes came to rest.
constexpr std::chrono::milliseconds kLastAnswers{500};

// If memory is locked, each thread's whole stack is in memory, 8 MB by default.
constexpr std::size_t kThreadStack = std::size_t{1} << 20;

constexpr const char* kUsage = R"(usage: stepdriver_node [--help] [name:=value ...]

Drives the axes of the parameter ~axes through services, and publishes their positions.
On SIGINT, SIGTERM, SIGQUIT, SIGHUP and `rosnode kill` it decelerates, disables the axes, releases
the lines and ends. On SIGUSR1 it writes what its flight recorder holds, as ~dump does.

  services    ~AXIS/move_to  ~AXIS/move_rounds  ~AXIS/plan  ~AXIS/microstep
              ~AXIS/set_position  ~AXIS/set_limits  ~AXIS/set_current
              ~AXIS/set_stall_threshold  ~AXIS/home  ~AXIS/enable  ~AXIS/sleep  ~AXIS/reset  ~AXIS/stop
              ~stop  ~emergency_stop  ~recover  ~speed_override  ~enable  ~home
              ~move_line  ~follow_path  ~append_path  ~plan_path  ~hold  ~resume  ~dump
              ~set_output  ~set_output_value  ~set_position_compare  ~probe
              ~rig/report  ~rig/emergency_stop  ~rig/AXIS/press_min  ~rig/AXIS/press_max
              ~rig/inputs/NAME (on the simulated rig)
  topics      joint_states  ~endstops  ~axis_states  ~AXIS/state  ~AXIS/driver  ~state
              ~io_states  ~latched_positions  /diagnostics  /clock (with ~publish_clock)
              ~jog  ~setpoint  ~AXIS/setpoint  ~command  (subscribed)
  actions     ~AXIS/move  ~AXIS/homing  ~homing  ~move_line  ~follow_path
              ~follow_joint_trajectory  ~latch  ~probe
  parameters  {}robot_description

Exit codes: 0 ended as asked, 1 wrong configuration, 2 a GPIO line can't be requested or
written, 3 the computer is too slow for its axes and ~realtime is enforce, 4 ended as asked, but
~state_file couldn't be written, 5 the computer had no memory or no thread left, 64 wrong usage.
Start it with: roslaunch stepdriver axis.launch
)";

/// The text contains all parameters that the node reads.
std::string usage() {
  constexpr std::size_t kWidth = 88;
  const std::string indent(14, ' ');
  std::string names;
  std::string line;
  for (const std::string& name : parameterNames()) {
    if (indent.size() + line.size() + name.size() + 1 > kWidth) {
      names.append(line).append("\n").append(indent);
      line.clear();
    }
    line.append("~").append(name).append("  ");
  }
  return fmt::format(kUsage, names + line + "\n" + indent);
}

/// Refuses new commands, decelerates, disables the axes, and lets every client get its answer.
///
/// @return the exit code.
int shutDown(machine::Machine& machine, CallQueues& queues, MoveActions& move_actions,
             LineAction& line_action, PathAction& path_action, TrajectoryAction& trajectory_action,
             LatchingAction& latching_action, StatePublisher& publisher, EndDespiteMaster& end) {
  int exit_code = kExitOk;
  try {
    machine.shutdown();
  } catch (const StateFileError&) {
    exit_code = kExitStateFile;
  } catch (const Error& error) {
    ROS_ERROR_NAMED("node", "Not all could be disabled: %s", error.what());
    exit_code = kExitGpio;
  }
  if (const std::string error = machine.stateFileError(); !error.empty()) {
    ROS_ERROR_NAMED("state_file",
                    "%s; the next start may not know the positions, or not trust them",
                    error.c_str());
  }
  move_actions.reportEnded();
  line_action.reportEnded();
  path_action.reportEnded();
  trajectory_action.reportEnded();
  latching_action.reportEnded();
  if (!machine.whyHung().empty()) {
    // All that reads or releases lines would wait for the chip.
    ROS_FATAL_NAMED("node",
                    "The node ends without releasing its lines: cut the power of the motors");
    std::this_thread::sleep_for(kLastAnswers);
    std::_Exit(kExitGpio);
  }
  end.begin(exit_code);
  queues.finish(kLastAnswers);
  publisher.stop();
  return exit_code;
}

void setThreadStacks() {
  pthread_attr_t attributes;
  if (pthread_attr_init(&attributes) != 0) return;
  if (pthread_attr_setstacksize(&attributes, kThreadStack) == 0) {
    pthread_setattr_default_np(&attributes);
  }
  pthread_attr_destroy(&attributes);
}

void warnOfSlowness(const std::vector<config::AxisConfig>& axes,
                    const pulse::Capability& capability) {
  if (capability.rights.anyRefused()) {
    ROS_WARN_NAMED("realtime", "Pulse thread: %s", capability.rights.text().c_str());
  }
  for (const std::string& complaint : machine::stepRates(axes, capability).complaints()) {
    ROS_WARN_NAMED("realtime", "%s. stepdriver_check says more", complaint.c_str());
  }
}

void warnWithoutClock() {
  if (ros::Time::isSystemTime() || !ros::Time::now().isZero()) return;
  ROS_WARN_NAMED("node",
                 "use_sim_time is true, but nothing publishes /clock: the stamps of all messages "
                 "are 0, and stamped trajectories aren't followed. Start the simulator, set "
                 "publish_clock to true, or delete the parameter /use_sim_time");
}

void warnOfPositions(const machine::Machine& machine) {
  for (const auto& axis : machine.axes()) {
    const std::string note = axis->state().position_note;
    if (note.empty()) continue;
    ROS_WARN_NAMED("position", "%s: its position is unverified: %s", axis->config().name.c_str(),
                   note.c_str());
  }
}

void stopForLostMaster(machine::Machine& machine) {
  ROS_ERROR_NAMED("master", "All axes come to rest: on_master_lost is stop");
  try {
    machine.stop();
  } catch (const Error& error) {
    ROS_ERROR_NAMED("master", "The stop failed: %s", error.what());
  }
}

void warnOfTrace(setup::Simulation& simulation) {
  try {
    simulation.rig().flushTrace();
  } catch (const Error& error) {
    ROS_WARN_NAMED("rig", "%s", error.what());
  }
}

/// Runs the node, once it is registered with the master.
///
/// @return the exit code.
int run(const Parameters& parameters, ros::NodeHandle node, ros::NodeHandle private_node,
        EndRequests& end_requests, EndDespiteMaster& end) {
  const NodeConfig& config = parameters.config;
  for (const std::string& note : parameters.notes) ROS_INFO_NAMED("limits", "%s", note.c_str());
  for (const std::string& text : parameters.warnings) ROS_WARN_NAMED("limits", "%s", text.c_str());
  setup::Hardware hardware(config, private_node.getNamespace());
  machine::Machine machine(config.axes, hardware.backend(), hardware.clock(), config.options());

  if (machine.emergencyStopped()) {
    ROS_WARN_NAMED(
        "emergency_stop",
        "The emergency stop input is active: no axis is enabled, none moves until recover");
  }
  warnOfPositions(machine);
  if (machine.capability()) warnOfSlowness(config.axes, *machine.capability());

  CallQueues queues(machine.axes().size(), config.outputs.size());
  FlightRecorderService recorder(machine, config.recorder, ros::this_node::getName());
  // Subscribers to latched topics need a queue too.
  node.setCallbackQueue(&queues.control());
  private_node.setCallbackQueue(&queues.control());
  StatePublisher publisher(node, private_node, machine, config.joint_state_rate);
  const MachineTime time(hardware.clock(),
                         hardware.simulation() != nullptr ? config.simulation.speed : 1.0);
  const IoPublisher io_publisher(private_node, machine, time);
  MasterDirectory directory;
  LatchedMessages latched(directory);
  ActionTopics topics(private_node, parameters.action_status_frequency, latched);
  std::deque<AxisServices> axis_services;
  for (std::size_t i = 0; i < machine.axes().size(); ++i) {
    axis_services.emplace_back(private_node, i, *machine.axes()[i], queues);
  }
  std::deque<AxisHomeService> axis_home_services;
  std::deque<HomingAction> homing_actions;
  for (std::size_t i = 0; i < machine.axes().size(); ++i) {
    axis::Axis& axis = *machine.axes()[i];
    axis_home_services.emplace_back(private_node, i, axis, queues);
    homing_actions.emplace_back(
        onQueue(queues.control(), ros::NodeHandle(private_node, axis.config().name)), axis, topics);
  }
  const MachineHomingAction machine_homing_action(private_node, machine, topics);
  MoveActions move_actions(private_node, machine, queues, topics);
  LineAction line_action(private_node, machine, queues, topics);
  PathAction path_action(private_node, machine, queues, topics);
  LatchingAction latching_action(private_node, machine, queues, topics, time);
  const ProbingAction probing_action(private_node, machine, topics);
  const MachineHomeService machine_home_service(private_node, machine, queues);
  MachineServices machine_services(private_node, machine, queues);
  if (hardware.simulation() != nullptr) machine_services.advertiseRig(*hardware.simulation());
  recorder.advertise(private_node, queues);
  const JogSubscriber jog_subscriber(private_node, machine, queues, latched, config.jog_timeout);
  const OutputSubscriber output_subscriber(private_node, machine, queues, latched);
  const SetpointSubscriber setpoint_subscriber(private_node, machine, queues, latched,
                                               config.setpoint_mode, config.setpoint_timeout);
  const TrajectoryCommand trajectory_command(private_node, machine, queues, latched,
                                             config.allow_slower);
  TrajectoryAction trajectory_action(private_node, machine, queues, topics, config.allow_slower);
  const std::string description = hardware.description();
  MasterWatch master_watch(private_node.resolveName("emergency_stop"),
                           loggedEvents(
                               [&] {
                                 if (config.stop_on_master_lost) stopForLostMaster(machine);
                               },
                               [&] { return latched.lookAgain(); }));
  const Diagnostics diagnostics(
      node, private_node, machine, queues, master_watch,
      config.hardware_id.empty() ? hardwareId(config.axes, description) : config.hardware_id,
      config, recorder);
  std::optional<ClockPublisher> clock_publisher;
  if (config.publish_clock) clock_publisher.emplace(private_node, hardware.clock());
  queues.start();
  publisher.start();
  master_watch.start();
  const ServiceManager service_manager(machine);
  ServiceManager::notifyReady();
  ROS_INFO_NAMED("node", "Ready: %zu %s on %s (%s)", machine.axes().size(),
                 machine.axes().size() == 1 ? "axis" : "axes", description.c_str(),
                 machine.figures().realtime.c_str());

  std::string who;
  for (int polls = 1; who.empty(); ++polls) {
    who = end_requests.waitFor(kPoll);
    if (polls == kPollsUntilClock) warnWithoutClock();
    if (end_requests.takeRecordingRequest()) recorder.request("SIGUSR1");
    if (const std::string error = machine.stateFileError(); !error.empty()) {
      ROS_ERROR_THROTTLE_NAMED(60.0, "state_file", "%s", error.c_str());
    }
  }
  ROS_INFO_NAMED("node", "Ending on %s", who.c_str());
  ServiceManager::notifyEnding();
  master_watch.stop();
  const int exit_code = shutDown(machine, queues, move_actions, line_action, path_action,
                                 trajectory_action, latching_action, publisher, end);
  if (hardware.simulation() != nullptr) warnOfTrace(*hardware.simulation());
  return exit_code;
}

/// @return the exit code.
int explainConfig(const ConfigError& error) {
  explain(error, ros::this_node::getName(), "Not started, no line was touched");
  return kExitConfig;
}

/// Registers the node and runs it. @return the exit code.
int runOrExplain(const Parameters& parameters, EndRequests& end_requests) {
  EndDespiteMaster end;
  // When the last handle is gone, roscpp shuts down, and so does the log: these handles live until
  // everything has been logged.
  const ros::NodeHandle node;
  const ros::NodeHandle private_node("~");
  closeToOtherComputers();
  end_requests.takeOverShutdownCall();
  try {
    return run(parameters, node, private_node, end_requests, end);
  } catch (const ConfigError& error) {
    return explainConfig(error);
  } catch (const GpioError& error) {
    ROS_FATAL_NAMED("node", "Not started: %s", error.what());
    return kExitGpio;
  } catch (const Refused& error) {
    ROS_FATAL_NAMED("node", "Not started: %s", error.what());
    return kExitTooSlow;
  } catch (const ExhaustedError& error) {
    ROS_FATAL_NAMED("node", "Not started: %s", error.what());
    return kExitExhausted;
  } catch (const boost::thread_resource_error& error) {
    ROS_FATAL_NAMED("node", "Not started: no thread can be started: %s", error.what());
    return kExitExhausted;
  } catch (const std::system_error& error) {
    ROS_FATAL_NAMED("node", "Not started: no thread can be started: %s", error.what());
    return kExitExhausted;
  } catch (const std::bad_alloc&) {
    ROS_FATAL_NAMED("node", "Not started: the computer has no memory left for this node");
    return kExitExhausted;
  } catch (const std::exception& error) {
    ROS_FATAL_NAMED("node", "Not started: %s", error.what());
    return kExitConfig;
  }
}

/// Registers the node only if its parameters are right. @return the exit code.
int start(EndRequests& end_requests) {
  try {
    return runOrExplain(readParameters(), end_requests);
  } catch (const ConfigError& error) {
    return explainConfig(error);
  }
}

}  // namespace
}  // namespace stepdriver::ros_node

int main(int argc, char** argv) {
  namespace node = stepdriver::ros_node;
  node::setThreadStacks();
  node::EndRequests end_requests(node::EndRequests::Usr1::kAsksForARecording);
  if (const auto code = node::handleArguments(argc, argv, node::usage())) return *code;
  ros::init(argc, argv, "stepdriver", ros::init_options::NoSigintHandler);
  if (!node::waitForMaster(end_requests)) return node::kExitOk;
  const int exit_code = node::start(end_requests);
  ros::shutdown();
  return exit_code;
}
