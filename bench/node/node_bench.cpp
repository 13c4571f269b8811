#include <ros/ros.h>
#include <sched.h>
#include <sensor_msgs/JointState.h>
#include <signal.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/MoveTo.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
#include <control_msgs/FollowJointTrajectoryAction.h>
namespace trajectory_messages = control_msgs;
#else
#include <stepdriver/FollowJointTrajectoryAction.h>
namespace trajectory_messages = stepdriver;
#endif

// Measures how long the node's start and a service call take, and what the node uses at rest.
// scripts/node_bench.sh starts a master, sets the node's parameters and calls this program:
//
//   node_bench stepdriver_node AXES OUT.JSON
//   node_bench --preparing stepdriver_node OUT.JSON [SECONDS POINTS]
//
// The second form measures how long a stop and an emergency stop take while a node with three axes
// prepares trajectories. The program starts itself in two other forms:
//
//   node_bench --serve AXES           a plain roscpp node for comparison: an empty service, and
//                                     joint_states of that many axes at 50 Hz
//   node_bench --send NUMBER POINTS   a client that sends trajectories, one after another

namespace {

using SteadyTime = std::chrono::steady_clock;

double secondsSince(SteadyTime::time_point begin) {
  return std::chrono::duration<double>(SteadyTime::now() - begin).count();
}

/// A program that is killed together with this one.
class Child {
 public:
  explicit Child(std::vector<std::string> arguments) : id_(fork()) {
    if (id_ < 0) throw std::runtime_error("fork failed");
    if (id_ > 0) return;
    const sched_param parameters{};
    sched_setscheduler(0, SCHED_OTHER, &parameters);
    std::vector<char*> argv;
    argv.reserve(arguments.size() + 1);
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(127);
  }
  ~Child() {
    kill(id_, SIGTERM);
    waitpid(id_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t id() const { return id_; }

 private:
  pid_t id_;
};

/// [s] Processor time that a process has used.
double processorTime(pid_t process) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(process, &clock) != 0 || clock_gettime(clock, &time) != 0) {
    throw std::runtime_error("the processor time of a process can't be read");
  }
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

/// [MB] Memory of a process.
double residentMemory(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/status");
  std::string word;
  while (file >> word && word != "VmRSS:") {
  }
  double kilobytes = 0.0;
  file >> kilobytes;
  return kilobytes / 1024.0;
}

/// [us] Negative if there was no answer.
double callTime(ros::ServiceClient& client, double position) {
  stepdriver::MoveTo call;
  call.request.position = position;
  const auto begin = SteadyTime::now();
  if (!client.call(call)) return -1.0;
  if (!call.response.success) throw std::runtime_error("refused: " + call.response.message);
  return secondsSince(begin) * 1e6;
}

/// Removes the calls without an answer.
/// @return how many there were.
int removeUnanswered(std::vector<double>& samples) {
  const auto answered =
      std::remove_if(samples.begin(), samples.end(), [](double t) { return t < 0.0; });
  const auto count = static_cast<int>(samples.end() - answered);
  samples.erase(answered, samples.end());
  return count;
}

double median(std::vector<double> samples) {
  if (samples.empty()) throw std::runtime_error("no call was answered");
  std::nth_element(samples.begin(), samples.begin() + static_cast<long>(samples.size() / 2),
                   samples.end());
  return samples[samples.size() / 2];
}

struct CallTimes {
  double node = 0.0;
  double empty = 0.0;
  int node_unanswered = 0;
  int empty_unanswered = 0;
};

/// Calls take turns, so that noise affects both services. Each call has a new target, so it plans a
/// motion, from the middle of the previous one.
CallTimes measureCalls(ros::NodeHandle& handle, bool persistent, double way) {
  constexpr int kCalls = 800;
  auto node = handle.serviceClient<stepdriver::MoveTo>("/stepdriver/a0/move_to", persistent);
  auto empty = handle.serviceClient<stepdriver::MoveTo>("/empty/move_to", persistent);
  std::vector<double> node_times;
  std::vector<double> empty_times;
  for (int i = 0; i < kCalls; ++i) {
    const double position = i % 2 == 0 ? way : 0.0;
    // A call without an answer has lost its connection.
    if (persistent && !node.isValid()) {
      node = handle.serviceClient<stepdriver::MoveTo>("/stepdriver/a0/move_to", true);
    }
    node_times.push_back(callTime(node, position));
    empty_times.push_back(callTime(empty, position));
  }
  const int node_unanswered = removeUnanswered(node_times);
  const int empty_unanswered = removeUnanswered(empty_times);
  return {median(node_times), median(empty_times), node_unanswered, empty_unanswered};
}

bool answer(stepdriver::MoveTo::Request& /*request*/, stepdriver::MoveTo::Response& response) {
  response.success = 1;
  return true;
}

int serve(int argc, char** argv, std::size_t axes) {
  ros::init(argc, argv, "empty");
  ros::NodeHandle handle("~");
  const auto service = handle.advertiseService("move_to", answer);
  const auto publisher = handle.advertise<sensor_msgs::JointState>("joint_states", 10);
  std::thread states([&] {
    sensor_msgs::JointState message;
    message.name.resize(axes, "a0_joint");
    message.position.resize(axes);
    message.velocity.resize(axes);
    for (auto due = SteadyTime::now(); ros::ok(); due += std::chrono::milliseconds(20)) {
      std::this_thread::sleep_until(due);
      message.header.stamp = ros::Time::now();
      publisher.publish(message);
    }
  });
  ros::AsyncSpinner spinner(1);
  spinner.start();
  states.join();
  return 0;
}

struct Idle {
  double node_percent = 0.0;
  double empty_percent = 0.0;
  double rate = 0.0;  ///< [Hz] of the node's joint_states
};

/// Both processes at once, so that noise affects both.
Idle measureIdle(pid_t node, pid_t empty, const std::atomic<int>& states) {
  constexpr double kIdle = 10.0;
  ros::WallDuration(3.0).sleep();
  const int states_before = states;
  const double node_before = processorTime(node);
  const double empty_before = processorTime(empty);
  const auto begin = SteadyTime::now();
  ros::WallDuration(kIdle).sleep();
  const double idle = secondsSince(begin);
  return {100.0 * (processorTime(node) - node_before) / idle,
          100.0 * (processorTime(empty) - empty_before) / idle, (states - states_before) / idle};
}

/// A slow wave of three axes, with a point every 10 ms, that begins and ends at rest.
trajectory_messages::FollowJointTrajectoryActionGoal longGoal(int points) {
  constexpr double kPeriod = 0.01;     // [s]
  constexpr double kAmplitude = 0.01;  // [m]
  constexpr double kRate = 0.5;        // [rad/s]
  const double duration = kPeriod * points;
  const auto position_at = [duration](double time) {
    const double begun = std::clamp(time, 0.0, 1.0);
    const double left = std::clamp(duration - time, 0.0, 1.0);
    return kAmplitude * begun * begun * left * left * std::sin(kRate * time);
  };
  trajectory_messages::FollowJointTrajectoryActionGoal goal;
  goal.goal.trajectory.joint_names = {"a0_joint", "a1_joint", "a2_joint"};
  goal.goal.trajectory.points.resize(static_cast<std::size_t>(points));
  for (int i = 1; i <= points; ++i) {
    const double time = kPeriod * i;
    const double velocity = (position_at(time + 1e-4) - position_at(time - 1e-4)) / 2e-4;
    auto& point = goal.goal.trajectory.points[static_cast<std::size_t>(i - 1)];
    point.time_from_start = ros::Duration(time);
    point.positions.assign(3, position_at(time));
    point.velocities.assign(3, i < points ? velocity : 0.0);
  }
  return goal;
}

/// The next goal is sent when the last one has its result.
int sendTrajectories(int argc, char** argv, const std::string& number, int points) {
  ros::init(argc, argv, "sender_" + number);
  ros::NodeHandle handle("/stepdriver/follow_joint_trajectory");
  auto goal = longGoal(points);
  int sent = 0;
  auto publisher =
      handle.advertise<trajectory_messages::FollowJointTrajectoryActionGoal>("goal", 1);
  const auto send_next = [&] {
    goal.goal_id.id = number + "_" + std::to_string(++sent);
    publisher.publish(goal);
  };
  const auto subscriber = handle.subscribe<trajectory_messages::FollowJointTrajectoryActionResult>(
      "result", 100,
      [&](const trajectory_messages::FollowJointTrajectoryActionResult::ConstPtr& result) {
        if (result->status.goal_id.id == goal.goal_id.id) send_next();
      });
  while (ros::ok() && (publisher.getNumSubscribers() == 0 || subscriber.getNumPublishers() == 0)) {
    ros::WallDuration(0.01).sleep();
  }
  send_next();
  ros::spin();
  return 0;
}

/// [ms] Calls of a service without a request, until there are enough of them.
std::vector<double> triggerTimes(ros::NodeHandle& handle, const std::string& service,
                                 const std::string& after, double seconds) {
  constexpr std::size_t kCalls = 1000;
  auto client = handle.serviceClient<std_srvs::Trigger>("/stepdriver/" + service, true);
  auto client_after = handle.serviceClient<std_srvs::Trigger>("/stepdriver/" + after, true);
  std::vector<double> times;
  const auto begin = SteadyTime::now();
  while (times.size() < kCalls && (times.empty() || secondsSince(begin) < seconds)) {
    ros::WallDuration(0.005 + 0.001 * static_cast<double>(times.size() % 7)).sleep();
    std_srvs::Trigger call;
    const auto called = SteadyTime::now();
    if (!client.call(call)) throw std::runtime_error(service + " doesn't answer");
    times.push_back(secondsSince(called) * 1e3);
    if (!after.empty() && !client_after.call(call)) {
      throw std::runtime_error(after + " doesn't answer");
    }
  }
  return times;
}

double percentile99(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  return samples[std::min(samples.size() - 1, samples.size() * 99 / 100)];
}

int measurePreparing(const std::string& self, const std::string& program, const std::string& out,
                     double seconds, const std::string& points) {
  ros::NodeHandle handle;
  const Child node({program, "__name:=stepdriver"});
  if (!ros::service::waitForService("/stepdriver/emergency_stop", 60000)) {
    throw std::runtime_error("the node doesn't come up");
  }
  std::atomic<int> results{0};
  const auto subscriber = handle.subscribe<trajectory_messages::FollowJointTrajectoryActionResult>(
      "/stepdriver/follow_joint_trajectory/result", 100,
      [&](const trajectory_messages::FollowJointTrajectoryActionResult::ConstPtr&) { ++results; });
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const Child first({self, "--send", "1", points});
  const Child second({self, "--send", "2", points});
  // When a stop ends the goals, one of them is under way.
  const auto begin = SteadyTime::now();
  auto stop = handle.serviceClient<std_srvs::Trigger>("/stepdriver/stop", true);
  for (std_srvs::Trigger call; results == 0; ros::WallDuration(0.1).sleep()) {
    if (!stop.call(call)) throw std::runtime_error("stop doesn't answer");
    if (secondsSince(begin) > 120.0) throw std::runtime_error("no trajectory has come to an end");
  }
  const std::vector<double> stops = triggerTimes(handle, "stop", "", seconds);
  const std::vector<double> emergency_stops =
      triggerTimes(handle, "emergency_stop", "recover", seconds);
  std::ofstream(out) << "{\"benchmarks\": [{\"name\": \"Node/preparing\""
                     << ", \"stop_p99_ms\": " << percentile99(stops)
                     << ", \"stop_calls\": " << stops.size()
                     << ", \"emergency_stop_p99_ms\": " << percentile99(emergency_stops)
                     << ", \"emergency_stop_calls\": " << emergency_stops.size()
                     << ", \"results\": " << results << "}]}\n";
  return 0;
}

int measure(const std::string& self, const std::string& program, int axes, const std::string& out) {
  ros::NodeHandle handle;
  std::atomic<int> states{0};
  const auto subscriber = handle.subscribe<sensor_msgs::JointState>(
      "/joint_states", 100, [&states](const sensor_msgs::JointState::ConstPtr&) { ++states; });
  std::atomic<int> other_states{0};
  const auto other_subscriber = handle.subscribe<sensor_msgs::JointState>(
      "/empty/joint_states", 100,
      [&other_states](const sensor_msgs::JointState::ConstPtr&) { ++other_states; });
  ros::AsyncSpinner spinner(1);
  spinner.start();

  const auto begin = SteadyTime::now();
  const Child node({program, "__name:=stepdriver"});
  const std::string last = "/stepdriver/a" + std::to_string(axes - 1) + "/move_to";
  while (!ros::service::exists(last, false)) {
    if (secondsSince(begin) > 60.0) throw std::runtime_error("the node doesn't come up");
    ros::WallDuration(0.002).sleep();
  }
  const double start = secondsSince(begin);

  const Child empty({self, "--serve", std::to_string(axes)});
  if (!ros::service::waitForService("/empty/move_to", 20000)) {
    throw std::runtime_error("the empty service doesn't come up");
  }
  const Idle idle = measureIdle(node.id(), empty.id(), states);
  // A step forward and back leaves the processor to the calls; a long move, with 8000 steps/s on
  // the simulated rig, doesn't.
  constexpr double kStep = 12.5e-6;
  constexpr double kLong = 0.1;
  const CallTimes calls = measureCalls(handle, false, kStep);
  const CallTimes kept = measureCalls(handle, true, kStep);
  const CallTimes moving = measureCalls(handle, false, kLong);

  std::ofstream(out) << "{\"benchmarks\": [{\"name\": \"Node/axes/" << axes << "\""
                     << ", \"start_s\": " << start << ", \"idle_percent\": " << idle.node_percent
                     << ", \"empty_idle_percent\": " << idle.empty_percent
                     << ", \"joint_states_hz\": " << idle.rate
                     << ", \"memory_mb\": " << residentMemory(node.id())
                     << ", \"call_us\": " << calls.node << ", \"empty_call_us\": " << calls.empty
                     << ", \"kept_call_us\": " << kept.node
                     << ", \"empty_kept_call_us\": " << kept.empty
                     << ", \"unanswered\": " << calls.node_unanswered + moving.node_unanswered
                     << ", \"empty_unanswered\": "
                     << calls.empty_unanswered + moving.empty_unanswered
                     << ", \"kept_unanswered\": " << kept.node_unanswered + kept.empty_unanswered
                     << ", \"moving_call_us\": " << moving.node
                     << ", \"empty_moving_call_us\": " << moving.empty << "}]}\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--serve") {
    return serve(argc, argv, std::stoul(argv[2]));
  }
  if (argc == 4 && std::string(argv[1]) == "--send") {
    return sendTrajectories(argc, argv, argv[2], std::atoi(argv[3]));
  }
  const bool preparing = argc >= 4 && std::string(argv[1]) == "--preparing";
  if (preparing ? argc != 4 && argc != 6 : argc != 4) {
    std::fprintf(stderr, "usage: node_bench stepdriver_node AXES OUT.JSON\n");
    return 2;
  }
  // Its clients stand for an operator's computer, which has a processor for them: they don't wait
  // for what is busy on this one, if they get the right to that.
  sched_param parameters{};
  parameters.sched_priority = sched_get_priority_min(SCHED_FIFO);
  if (preparing && sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
    std::fprintf(stderr, "node_bench: no right to SCHED_FIFO, so its own wake-ups count too\n");
  }
  ros::init(argc, argv, "node_bench", ros::init_options::NoSigintHandler);
  try {
    if (preparing) {
      return measurePreparing(argv[0], argv[2], argv[3], argc == 6 ? std::atof(argv[4]) : 60.0,
                              argc == 6 ? argv[5] : "300000");
    }
    return measure(argv[0], argv[1], std::atoi(argv[2]), argv[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "node_bench: %s\n", error.what());
    return 1;
  }
}
