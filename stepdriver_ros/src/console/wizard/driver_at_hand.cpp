#include "driver_at_hand.h"

#include <ros/callback_queue.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/MoveTo.h>

#include "../../client/ask_service.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

constexpr double kPoll = 0.02;        // [s]
constexpr double kFirstState = 10.0;  // [s]

}  // namespace

void DriverAtHand::wait() {
  ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll));
  client_.poll();
}

void DriverAtHand::poll() {
  ros::getGlobalCallbackQueue()->callAvailable();
  client_.poll();
}

void DriverAtHand::awaitState() {
  const double begin = steadyNow();
  while (states() == 0) {
    if (steadyNow() - begin > kFirstState) {
      throw Error("no state of " + session_.driverName() + " comes: is it running?");
    }
    wait();
  }
}

AxisView DriverAtHand::state(const std::string& axis) {
  poll();
  const AxisView* const view = session_.driver().axis(axis);
  if (view == nullptr || !session_.driver().live(steadyNow())) {
    throw Error("no state of " + session_.driverName() + " comes any more");
  }
  return *view;
}

client::Answer DriverAtHand::enable(const std::string& axis, bool on) {
  std_srvs::SetBool::Request request;
  request.data = on;
  return client::askService<std_srvs::SetBool>(service(axis, "enable"), request);
}

client::Answer DriverAtHand::move(const std::string& axis, double distance, double speed) {
  const axis::AxisConfig* const config = session_.driver().config(axis);
  if (config == nullptr) return {false, axis + " has no configuration any more"};
  const double units = axis::configUnitsPerUnit(config->kind);
  MoveTo::Request request;
  request.position = distance / units;
  request.relative = true;
  request.velocity = speed / units;
  return client::askService<MoveTo>(service(axis, "move_to"), request);
}

client::Answer DriverAtHand::stop(const std::string& axis) {
  return client::askService<std_srvs::Trigger>(service(axis, "stop"));
}

std::string DriverAtHand::service(const std::string& axis, const std::string& name) const {
  return session_.driverName() + "/" + axis + "/" + name;
}

}  // namespace stepdriver::console
