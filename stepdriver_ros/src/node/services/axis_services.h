#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/Plan.h>
#include <stepdriver/SetCurrent.h>
#include <stepdriver/SetLimits.h>
#include <stepdriver/SetPosition.h>
#include <stepdriver/SetStallThreshold.h>

#include <string>
#include <vector>

#include "node/calls/call_queues.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// The services of one axis, below its name. Any thread of their queues calls them.
class AxisServices {
 public:
  /// @param node the node's private handle.
  /// @param index of the axis, which determines its queue.
  /// @param queues outlive the services.
  /// @param axis outlives the queues.
  AxisServices(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
               CallQueues& queues);
  AxisServices(const AxisServices&) = delete;
  AxisServices& operator=(const AxisServices&) = delete;

 private:
  template <typename Service>
  using Handler = bool (AxisServices::*)(typename Service::Request&, typename Service::Response&);

  template <typename Service>
  void advertise(const std::string& name, Handler<Service> handler, ros::CallbackQueue& queue);

  bool moveTo(MoveTo::Request& request, MoveTo::Response& response);
  bool moveRounds(MoveRounds::Request& request, MoveRounds::Response& response);
  bool plan(Plan::Request& request, Plan::Response& response);
  bool microstep(Microstep::Request& request, Microstep::Response& response);
  bool setLimits(SetLimits::Request& request, SetLimits::Response& response);
  bool setCurrent(SetCurrent::Request& request, SetCurrent::Response& response);
  bool setStallThreshold(SetStallThreshold::Request& request,
                         SetStallThreshold::Response& response);
  bool setPosition(SetPosition::Request& request, SetPosition::Response& response);
  bool enable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool sleep(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool reset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  template <typename Response>
  void respondToMove(const axis::Move& move, bool wait, Response& response);

  double stepsPerUnit() const;
  /// Rounded to a microstep of the current mode.
  std::string placeText(double position) const;
  /// "moves to 0.1 m in 1.2 s", or "is already at 0.1 m"
  ///
  /// @param moves "moves" or "would move".
  std::string moveText(const char* moves, const axis::Move& move) const;

  axis::Axis& axis_;
  ros::NodeHandle node_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace stepdriver::ros_node
