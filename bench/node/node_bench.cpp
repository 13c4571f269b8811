#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <signal.h>
#include <stepdriver/MoveTo.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

// What the node costs: how long its start and a service call take, and what it uses at rest.
// scripts/node_bench.sh starts a master, sets the node's parameters and calls it:
//
//   node_bench stepdriver_node AXES OUT.JSON
//   node_bench --serve                         the empty service that calls are measured against

namespace {

using SteadyTime = std::chrono::steady_clock;

double secondsSince(SteadyTime::time_point begin) {
  return std::chrono::duration<double>(SteadyTime::now() - begin).count();
}

/// A program that is killed with this.
class Child {
 public:
  explicit Child(std::vector<std::string> arguments) : id_(fork()) {
    if (id_ < 0) throw std::runtime_error("fork failed");
    if (id_ > 0) return;
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

/// [s] of a processor that a process has used.
double processorTime(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string text;
  std::getline(file, text);
  std::istringstream fields(text.substr(text.rfind(')') + 2));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0.0;
  double system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// [MB] that a process has in memory.
double residentMemory(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/status");
  std::string word;
  while (file >> word && word != "VmRSS:") {
  }
  double kilobytes = 0.0;
  file >> kilobytes;
  return kilobytes / 1024.0;
}

int unanswered = 0;

/// [us] Negative where there was no answer.
double callTime(ros::ServiceClient& client, double position) {
  stepdriver::MoveTo call;
  call.request.position = position;
  const auto begin = SteadyTime::now();
  if (!client.call(call)) {
    ++unanswered;
    return -1.0;
  }
  if (!call.response.success) throw std::runtime_error("refused: " + call.response.message);
  return secondsSince(begin) * 1e6;
}

double median(std::vector<double> samples) {
  samples.erase(std::remove_if(samples.begin(), samples.end(), [](double t) { return t < 0.0; }),
                samples.end());
  if (samples.empty()) throw std::runtime_error("no call was answered");
  std::nth_element(samples.begin(), samples.begin() + static_cast<long>(samples.size() / 2),
                   samples.end());
  return samples[samples.size() / 2];
}

struct CallTimes {
  double node = 0.0;
  double empty = 0.0;
};

/// Calls take turns, so that noise meets both. The target is a new one each time, so that each call
/// plans a motion, from the midst of the last one.
CallTimes measureCalls(ros::NodeHandle& handle, bool persistent, double way) {
  constexpr int kCalls = 800;
  auto node = handle.serviceClient<stepdriver::MoveTo>("/stepdriver/a0/move_to", persistent);
  auto empty = handle.serviceClient<stepdriver::MoveTo>("/empty/move_to", persistent);
  std::vector<double> node_times;
  std::vector<double> empty_times;
  for (int i = 0; i < kCalls; ++i) {
    const double position = i % 2 == 0 ? way : 0.0;
    // One that got no answer has lost its connection.
    if (persistent && !node.isValid()) {
      node = handle.serviceClient<stepdriver::MoveTo>("/stepdriver/a0/move_to", true);
    }
    node_times.push_back(callTime(node, position));
    empty_times.push_back(callTime(empty, position));
  }
  return {median(node_times), median(empty_times)};
}

bool answer(stepdriver::MoveTo::Request& /*request*/, stepdriver::MoveTo::Response& response) {
  response.success = 1;
  return true;
}

int serve(int argc, char** argv) {
  ros::init(argc, argv, "empty");
  ros::NodeHandle handle("~");
  const auto service = handle.advertiseService("move_to", answer);
  ros::spin();
  return 0;
}

int measure(const std::string& self, const std::string& program, int axes, const std::string& out) {
  ros::NodeHandle handle;
  int states = 0;
  const auto subscriber = handle.subscribe<sensor_msgs::JointState>(
      "/joint_states", 100, [&states](const sensor_msgs::JointState::ConstPtr&) { ++states; });
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

  constexpr double kIdle = 10.0;
  ros::WallDuration(3.0).sleep();
  const int states_before = states;
  const double used_before = processorTime(node.id());
  const auto idle_begin = SteadyTime::now();
  ros::WallDuration(kIdle).sleep();
  const double idle = secondsSince(idle_begin);
  const double used = processorTime(node.id()) - used_before;
  const double rate = (states - states_before) / idle;

  const Child empty({self, "--serve"});
  if (!ros::service::waitForService("/empty/move_to", 20000)) {
    throw std::runtime_error("the empty service doesn't come up");
  }
  // A step there and back leaves the processor to the calls; a long way, with 8000 steps/s on the
  // simulated rig, doesn't.
  constexpr double kStep = 12.5e-6;
  constexpr double kLong = 0.1;
  const CallTimes calls = measureCalls(handle, false, kStep);
  const CallTimes kept = measureCalls(handle, true, kStep);
  const CallTimes moving = measureCalls(handle, false, kLong);

  std::ofstream(out) << "{\"benchmarks\": [{\"name\": \"Node/axes/" << axes << "\""
                     << ", \"start_s\": " << start << ", \"idle_percent\": " << 100.0 * used / idle
                     << ", \"joint_states_hz\": " << rate
                     << ", \"memory_mb\": " << residentMemory(node.id())
                     << ", \"call_us\": " << calls.node << ", \"empty_call_us\": " << calls.empty
                     << ", \"kept_call_us\": " << kept.node
                     << ", \"empty_kept_call_us\": " << kept.empty
                     << ", \"unanswered\": " << unanswered
                     << ", \"moving_call_us\": " << moving.node
                     << ", \"empty_moving_call_us\": " << moving.empty << "}]}\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string(argv[1]) == "--serve") return serve(argc, argv);
  if (argc != 4) {
    std::fprintf(stderr, "usage: node_bench stepdriver_node AXES OUT.JSON\n");
    return 2;
  }
  ros::init(argc, argv, "node_bench", ros::init_options::NoSigintHandler);
  try {
    return measure(argv[0], argv[1], std::atoi(argv[2]), argv[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "node_bench: %s\n", error.what());
    return 1;
  }
}
