#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <string>
#include <vector>

// Measures when the joint_states of several nodes are first heard, and at what rate they come
// afterwards. scripts/two_hosts.sh calls it:
//
//   node_listener SECONDS TOPIC...
//
// Prints "listening". After it has heard each topic for SECONDS, it prints a line for each: the
// topic, the time of its first message in ns since 1970, and its rate in Hz. Exit code 1 if a topic
// isn't heard.

namespace {

constexpr std::chrono::seconds kBound{60};

using WallTime = std::chrono::system_clock;
using SteadyTime = std::chrono::steady_clock;

struct Heard {
  ros::Subscriber subscriber;
  WallTime::time_point first;
  SteadyTime::time_point begin;
  SteadyTime::time_point last;
  int count = 0;

  double seconds() const { return std::chrono::duration<double>(last - begin).count(); }
};

void hear(Heard& heard) {
  heard.last = SteadyTime::now();
  if (heard.count++ > 0) return;
  heard.first = WallTime::now();
  heard.begin = heard.last;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "listener", ros::init_options::AnonymousName);
  if (argc < 3) {
    std::fprintf(stderr, "usage: node_listener SECONDS TOPIC...\n");
    return 2;
  }
  const double seconds = std::atof(argv[1]);
  const std::vector<std::string> topics(argv + 2, argv + argc);
  ros::NodeHandle handle;
  std::deque<Heard> all(topics.size());
  for (std::size_t i = 0; i < topics.size(); ++i) {
    all[i].subscriber = handle.subscribe<sensor_msgs::JointState>(
        topics[i], 100, [&all, i](const sensor_msgs::JointState::ConstPtr&) { hear(all[i]); });
  }
  std::printf("listening\n");
  std::fflush(stdout);

  const auto begin = SteadyTime::now();
  const auto complete = [&all, seconds] {
    return std::all_of(all.begin(), all.end(),
                       [seconds](const Heard& heard) { return heard.seconds() >= seconds; });
  };
  while (!complete() && SteadyTime::now() < begin + kBound) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
  }
  for (std::size_t i = 0; i < topics.size(); ++i) {
    const auto first = std::chrono::nanoseconds(all[i].first.time_since_epoch()).count();
    const double rate = all[i].count > 1 ? (all[i].count - 1) / all[i].seconds() : 0.0;
    std::printf("%s %lld %.2f\n", topics[i].c_str(), static_cast<long long>(first), rate);
  }
  return complete() ? 0 : 1;
}
