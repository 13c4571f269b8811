#include "console.h"

#include <ros/callback_queue.h>
#include <ros/init.h>
#include <ros/this_node.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

#include "common/master_watch.h"
#include "driver_client.h"
#include "screen.h"
#include "session.h"
#include "terminal.h"

namespace stepdriver::console {
namespace {

constexpr int kKeyPoll = 20;         // [ms] for a key
constexpr double kDrawPeriod = 0.1;  // [s] if no key was pressed
// Time for the last message, which roscpp sends in a thread of its own.
constexpr std::chrono::milliseconds kLastWords{50};

/// From any thread: the terminal shows what is printed.
void print(const char* text) {
  std::puts(text);
  std::fflush(stdout);
}

/// What the user reads of the master.
ros_node::MasterWatch::Events shownEvents() {
  ros_node::MasterWatch::Events events;
  events.lost = [] { print("the ROS master doesn't answer"); };
  events.found = [] { print("the ROS master answers again"); };
  events.forgotten = [] { return true; };
  events.registered = [](const ros_node::Registrations& /*all*/) {
    print("the ROS master was restarted; the console finds the driver when it is back");
  };
  return events;
}

/// The terminal is restored before anything can keep the program from ending.
void runScreen(Session& session, DriverClient& client, ros_node::EndRequests& end_requests) {
  Terminal terminal;
  ros_node::MasterWatch master(ros::this_node::getName() + "/get_loggers", shownEvents());
  master.start();
  double drawn = 0.0;
  while (!session.ended() && end_requests.waitFor(std::chrono::milliseconds(0)).empty()) {
    const auto keys = terminal.keys(kKeyPoll);
    if (!keys) return;
    // First, so that keys are checked against the latest state.
    ros::getGlobalCallbackQueue()->callAvailable();
    const double now = steadyNow();
    if (!keys->empty()) client.carryOut(session.press(*keys, now));
    client.carryOut(session.tick(now));
    client.poll();
    for (const std::string& line : terminal.printed()) session.messages().say(line);
    if (keys->empty() && now - drawn < kDrawPeriod) continue;
    drawn = now;
    terminal.show(draw(session, terminal.rows(), terminal.columns(), steadyNow()));
  }
}

}  // namespace

void runConsole(const ros::NodeHandle& node, const std::string& driver, const Options& options,
                ros_node::EndRequests& end_requests) {
  Session session(driver, options.speeds);
  DriverClient client(node, session, readDriverParameters(driver));
  const auto end = [&] {
    client.carryOut(session.rest());
    std::this_thread::sleep_for(kLastWords);
    ros::shutdown();  // this ends unanswered calls too
  };
  try {
    runScreen(session, client, end_requests);
  } catch (...) {
    end();
    throw;
  }
  end();
}

}  // namespace stepdriver::console
