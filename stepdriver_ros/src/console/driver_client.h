#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <rosgraph_msgs/Log.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/DriverState.h>
#include <stepdriver/Endstops.h>
#include <stepdriver/IoStates.h>

#include <future>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/background_call.h"
#include "driver_parameters.h"
#include "emergency_stop_client.h"
#include "session.h"
#include "table_units.h"

namespace stepdriver::console {

/// Passes the driver's messages and answers to a session, and the session's orders to the driver.
/// None of its functions waits for the driver or the master.
///
/// For one thread, which also serves the global callback queue. The destructor waits for the calls
/// in progress, which end with ros::shutdown().
class DriverClient {
 public:
  /// @param parameters the current result of readDriverParameters().
  /// @param session outlives this.
  DriverClient(ros::NodeHandle node, Session& session, const DriverParameters& parameters);
  DriverClient(const DriverClient&) = delete;
  DriverClient& operator=(const DriverClient&) = delete;

  void carryOut(const Orders& orders);
  /// Passes on the answers that have arrived. Call it often.
  void poll();

 private:
  struct Lane {
    Call call;
    client::BackgroundCall background;
  };

  void onMessage(const AxisStates& states);
  void onMessage(const Endstops& endstops);
  void onMessage(const IoStates& states);
  void onMessage(const std::string& axis, const DriverState& chips);
  void onMessage(const rosgraph_msgs::Log& log);
  void configure(const DriverParameters& parameters);
  void noticeTheDriver();
  void takeParameters();
  void start(const Call& call);
  void publish(const std::vector<HeldJog::Order>& jogs);
  double unitsOf(const std::string& axis) const;
  TableUnits tableUnitsOf(const std::string& axis) const;

  Session& session_;
  ros::NodeHandle node_;
  const std::string driver_;
  std::map<std::string, std::unique_ptr<Lane>> lanes_;  // one for each call name
  EmergencyStopClient emergency_stop_;
  std::future<DriverParameters> parameters_;  // while they are being read again
  bool was_live_ = false;
  ros::Publisher jog_;
  ros::Subscriber states_;
  ros::Subscriber endstops_;
  ros::Subscriber io_;
  ros::Subscriber log_;
  std::vector<ros::Subscriber> chips_;  // of the axes whose drivers are on a UART
};

/// [s] The time on the clock of sessions.
double steadyNow();

}  // namespace stepdriver::console
