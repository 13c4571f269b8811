#include "driver_at_hand.h"

#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/SetPosition.h>

#include <algorithm>

#include "common/ask_service.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

constexpr double kCallbackPoll = 0.02;  // [s]
constexpr double kFirstState = 10.0;    // [s]
// Longer than the screen's limit for a stale state, because this ends the wizard.
constexpr double kGone = 2.0;  // [s]

}  // namespace

void DriverAtHand::wait() {
  ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kCallbackPoll));
  client_.poll();
}

void DriverAtHand::poll() {
  ros::getGlobalCallbackQueue()->callAvailable();
  client_.poll();
  if (session_.driver().age(steadyNow()).value_or(0.0) > kGone) {
    throw Error("no state of " + session_.driverName() + " arrives any more");
  }
}

bool DriverAtHand::complete() const {
  const auto& axes = session_.driver().axes();
  return !axes.empty() && std::all_of(axes.begin(), axes.end(),
                                      [](const AxisView& axis) { return axis.switches_known; });
}

void DriverAtHand::awaitState() {
  const double begin = steadyNow();
  while (!complete()) {
    if (steadyNow() - begin > kFirstState) {
      throw Error("no state of " + session_.driverName() + " arrives: is it running?");
    }
    wait();
  }
}

AxisView DriverAtHand::state(const std::string& axis) {
  poll();
  const AxisView* const view = session_.driver().axis(axis);
  if (view == nullptr) {
    throw Error(fmt::format("{} has no axis {} any more", session_.driverName(), axis));
  }
  return *view;
}

client::Answer DriverAtHand::enable(const std::string& axis, bool on) {
  std_srvs::SetBool::Request request;
  request.data = on;
  return client::askService<std_srvs::SetBool>(service(axis, "enable"), request);
}

client::Answer DriverAtHand::setPosition(const std::string& axis, double position) {
  SetPosition::Request request;
  request.position = position / unitsOf(axis);
  const auto response = client::respondedBy<SetPosition>(service(axis, "set_position"), request);
  if (response.success == 0) return {false, response.message};
  const double units = unitsOf(axis);
  const std::string unit = configUnitOf(session_.driver().config(axis)->kind);
  return {true, fmt::format("{}: this position is {} from now on", axis,
                            TableUnits{units, unit}.place(response.position))};
}

client::Answer DriverAtHand::move(const std::string& axis, double distance, double speed) {
  MoveTo::Request request;
  request.position = distance / unitsOf(axis);
  request.relative = true;
  request.velocity = speed / unitsOf(axis);
  return client::askService<MoveTo>(service(axis, "move_to"), request);
}

client::Answer DriverAtHand::stop(const std::string& axis) {
  return client::askService<std_srvs::Trigger>(service(axis, "stop"));
}

double DriverAtHand::unitsOf(const std::string& axis) const {
  const config::AxisConfig* const config = session_.driver().config(axis);
  if (config == nullptr) throw Error(axis + " has no configuration any more");
  return config::configUnitsPerUnit(config->kind);
}

std::string DriverAtHand::service(const std::string& axis, const std::string& name) const {
  return fmt::format("{}/{}/{}", session_.driverName(), axis, name);
}

}  // namespace stepdriver::console
