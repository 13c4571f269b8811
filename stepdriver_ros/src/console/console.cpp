#include "console.h"

#include <ros/callback_queue.h>
#include <ros/init.h>

#include <chrono>
#include <memory>
#include <thread>

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

/// The terminal is restored before anything can keep the program from ending.
void runScreen(Session& session, DriverClient& client, ros_node::EndRequests& end_requests) {
  Terminal terminal;
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
    ros::shutdown();  // also ends unanswered calls
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
