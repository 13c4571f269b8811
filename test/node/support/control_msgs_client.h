#pragma once

#include <actionlib/client/simple_action_client.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cstring>
#include <string>

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
#include <control_msgs/FollowJointTrajectoryAction.h>
#include <control_msgs/JointTrajectoryControllerState.h>
#else
#include <stepdriver/FollowJointTrajectoryAction.h>
#include <stepdriver/JointTrajectoryControllerState.h>
#endif

namespace stepdriver::node_test {

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
namespace action_msgs = control_msgs;
#else
namespace action_msgs = stepdriver;
#endif

/// A message as a program that was built with control_msgs sees it: with that package's name in its
/// type.
template <typename Message>
struct OfControlMsgs : Message {
  using Ptr = boost::shared_ptr<OfControlMsgs>;
  using ConstPtr = boost::shared_ptr<const OfControlMsgs>;
};

/// FollowJointTrajectory as MoveIt's clients use it.
struct ControlMsgsAction {
  using _action_goal_type = OfControlMsgs<action_msgs::FollowJointTrajectoryActionGoal>;
  using _action_result_type = OfControlMsgs<action_msgs::FollowJointTrajectoryActionResult>;
  using _action_feedback_type = OfControlMsgs<action_msgs::FollowJointTrajectoryActionFeedback>;
};

using TrajectoryClient = actionlib::SimpleActionClient<ControlMsgsAction>;

}  // namespace stepdriver::node_test

namespace ros {
namespace message_traits {

template <typename M>
struct IsMessage<stepdriver::node_test::OfControlMsgs<M>> : TrueType {};
template <typename M>
struct HasHeader<stepdriver::node_test::OfControlMsgs<M>> : HasHeader<M> {};
template <typename M>
struct MD5Sum<stepdriver::node_test::OfControlMsgs<M>> : MD5Sum<M> {
  static const char* value(const M& /*message*/) { return MD5Sum<M>::value(); }
  static const char* value() { return MD5Sum<M>::value(); }
};
template <typename M>
struct Definition<stepdriver::node_test::OfControlMsgs<M>> {
  static const char* value(const M& /*message*/) { return value(); }
  static const char* value() { return Definition<M>::value(); }
};
template <typename M>
struct DataType<stepdriver::node_test::OfControlMsgs<M>> {
  static const char* value(const M& /*message*/) { return value(); }
  static const char* value() {
    static const std::string name =
        std::string("control_msgs") + std::strchr(DataType<M>::value(), '/');
    return name.c_str();
  }
};

}  // namespace message_traits

namespace serialization {

template <typename M>
struct Serializer<stepdriver::node_test::OfControlMsgs<M>> : Serializer<M> {};

}  // namespace serialization
}  // namespace ros
