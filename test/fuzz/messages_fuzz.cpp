#include <actionlib_msgs/GoalID.h>
#include <fmt/format.h>
#include <ros/serialization.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/FollowPath.h>
#include <stepdriver/FollowPathActionGoal.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeActionGoal.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/HomeAxesActionGoal.h>
#include <stepdriver/Jog.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveActionGoal.h>
#include <stepdriver/MoveLine.h>
#include <stepdriver/MoveLineActionGoal.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/Plan.h>
#include <stepdriver/SetLimits.h>
#include <stepdriver/SetPosition.h>
#include <stepdriver/SpeedOverride.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz/fuzz_input.h"
#include "node/actions/follow_joint_trajectory.h"
#include "node/actions/trajectory_tolerances.h"
#include "node/calls/bounded.h"
#include "node/calls/tcpros.h"
#include "node/calls/trigger_session.h"
#include "node/line_request.h"
#include "node/path_request.h"
#include "node/topics/trajectory_message.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"

// The first byte of the input chooses a kind of message, and the others are its bytes as a client
// sends them. It is refused, or read as it was written. The machine refuses what it asks for with a
// message and moves nothing, or stays within the limits of its axes.

namespace stepdriver::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// @return no value if the message is refused.
template <typename M>
std::optional<M> readMessage(Bytes bytes) {
  ros_node::Bounded<M> message;
  bytes.reserve(1);  // the stream computes with the address, also of no bytes
  ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  try {
    ros::serialization::deserialize(stream, message);
  } catch (const Refused& refused) {
    requireMessage(refused.what());
    return std::nullopt;
  } catch (const ros::serialization::StreamOverrunException&) {
    return std::nullopt;
  }
  const M& read = message;
  const std::uint32_t length = ros::serialization::serializationLength(read);
  require(length == bytes.size() - stream.getLength(), "a message is as long as the bytes read");
  Bytes again(length);
  ros::serialization::OStream output(again.data(), length);
  ros::serialization::serialize(output, read);
  require(std::equal(again.begin(), again.end(), bytes.begin()), "a message is what its bytes say");
  return read;
}

/// Two axes on the rig, one with soft limits.
class MachineOnRig {
 public:
  MachineOnRig() : bench_(axes()) {}

  test::UnthreadedMachine& machine() { return *bench_.machine; }
  axis::Axis& x() { return bench_.axis("x"); }

  /// What a client asked for.
  void serve(const std::function<void()>& action) {
    bool refused = false;
    try {
      action();
    } catch (const Refused& error) {
      requireMessage(error.what());
      refused = true;
    }
    for (int i = 0; i < 10; ++i) {
      machine().advance(0.01);
      for (const auto& axis : machine().axes()) check(*axis, refused);
    }
    machine().stop();
    machine().advance(1.0);
    for (const auto& axis : machine().axes()) {
      require(!axis->state().moving, axis->config().name + " rests a second after a stop");
      const auto violations = test::violationsOf(bench_.report(axis->config().name));
      require(violations.empty(), "the chip sees " + violations);
    }
  }

 private:
  static std::vector<config::AxisConfig> axes() {
    config::AxisConfig x = test::linearAxis("x", 1000.0, 0.1, 1.0);
    x.min_position = -0.05;
    x.max_position = 0.05;
    config::AxisConfig y = test::linearAxis("y", 1000.0, 0.2, 2.0);
    y.jerk = 40.0;
    return {x, y};
  }

  void check(const axis::Axis& axis, bool refused) {
    const config::AxisConfig& config = axis.config();
    const axis::AxisState state = axis.state();
    if (refused) {
      require(!state.moving && bench_.pulses(config.name) == 0,
              "what was refused doesn't move " + config.name);
    }
    require(std::isfinite(state.position) && std::isfinite(state.target), "a place is a number");
    require(std::abs(state.velocity) <= config.max_speed * 1.011 + 1e-3,
            fmt::format("{} moves at {} of {} m/s", config.name, state.velocity, config.max_speed));
    if (!config.max_position) return;
    require(std::abs(state.position) <= *config.max_position + 1.01e-3,
            fmt::format("{} is at {} m, within its limits", config.name, state.position));
  }

  test::Bench bench_;
};

void take(const Jog& message) {
  if (message.name.size() != 1 || message.velocity.size() != 1) return;
  MachineOnRig rig;
  rig.serve([&] { rig.machine().axis(message.name.front()).jog(message.velocity.front()); });
}

void take(const std_msgs::Float64MultiArray& message) {
  if (message.data.size() != 2) return;
  MachineOnRig rig;
  rig.serve([&] {
    const auto mode = message.layout.data_offset % 2 == 1 ? machine::SetpointMode::kVelocity
                                                          : machine::SetpointMode::kPosition;
    for (const std::string& why : rig.machine().followSetpoints(
             mode, 0.1, {{"x", message.data[0], {}}, {"y", message.data[1], {}}})) {
      if (!why.empty()) requireMessage(why);
    }
  });
}

void take(const trajectory_msgs::JointTrajectory& message) {
  MachineOnRig rig;
  rig.serve([&] {
    const bool allow_slower = message.header.seq % 2 == 1;
    ros_node::followMessage(rig.machine(), message, ros_node::axisOfJoint(rig.machine()),
                            allow_slower);
  });
}

void take(const ros_node::action_msgs::FollowJointTrajectoryActionGoal& message) {
  try {
    const auto tolerances = ros_node::readTolerances(message.goal);
    require(tolerances.path.size() == message.goal.trajectory.joint_names.size(),
            "each joint has a tolerance");
  } catch (const Refused& refused) {
    requireMessage(refused.what());
  }
  take(message.goal.trajectory);
}

void take(const MoveTo::Request& message) {
  MachineOnRig rig;
  rig.serve([&] { rig.x().moveTo(message.position, message.relative != 0, message.velocity); });
}

void take(const MoveActionGoal& message) {
  MachineOnRig rig;
  rig.serve([&] {
    rig.x().moveTo(message.goal.position, message.goal.relative != 0, message.goal.velocity);
  });
}

void take(const MoveRounds::Request& message) {
  MachineOnRig rig;
  rig.serve([&] { rig.x().moveRounds(message.rounds, message.velocity); });
}

void take(const Plan::Request& message) {
  MachineOnRig rig;
  rig.serve([&] {
    const axis::MovePlan plan =
        rig.x().plan(message.position, message.relative != 0, message.velocity);
    require(std::isfinite(plan.move.duration) && plan.move.duration >= 0.0, "a plan takes a time");
    for (const axis::MovePiece& piece : plan.pieces) {
      require(piece.duration > 0.0 && std::abs(piece.velocity) <= 0.1 * 1.001,
              fmt::format("a piece takes {} s, from {} m/s", piece.duration, piece.velocity));
    }
  });
}

void take(const Microstep::Request& message) {
  MachineOnRig rig;
  rig.serve([&] { rig.x().setMicrosteps(message.microsteps); });
}

void take(const SetLimits::Request& message) {
  MachineOnRig rig;
  rig.serve([&] {
    rig.x().setLimits(
        {message.max_speed, message.acceleration, message.deceleration, message.jerk});
    rig.x().moveTo(0.01);
  });
}

void take(const SetPosition::Request& message) {
  MachineOnRig rig;
  rig.serve([&] {
    rig.x().setPosition(message.position);
    require(rig.x().state().position_valid, "a position that was set is valid");
  });
  // The other axis has no soft limits.
  MachineOnRig free;
  free.serve([&] {
    axis::Axis& y = free.machine().axis("y");
    y.setPosition(message.position);
    y.moveTo(0.01, true);
  });
}

void take(const SpeedOverride::Request& message) {
  MachineOnRig rig;
  rig.serve([&] {
    rig.machine().setSpeedOverride(message.factor);
    rig.x().moveTo(0.01);
  });
}

template <typename Fields>
void takeLine(const Fields& fields) {
  MachineOnRig rig;
  rig.serve([&] { rig.machine().moveLine(ros_node::lineRequest(fields)); });
}
void take(const MoveLine::Request& message) { takeLine(message); }
void take(const MoveLineActionGoal& message) { takeLine(message.goal); }

template <typename Fields>
void takePath(const Fields& fields) {
  MachineOnRig rig;
  rig.serve([&] { rig.machine().followPath(ros_node::pathRequest(fields)); });
}
void take(const FollowPath::Request& message) { takePath(message); }
void take(const FollowPathActionGoal& message) { takePath(message.goal); }

void take(const HomeAxes::Request& message) {
  MachineOnRig rig;
  rig.serve([&] { rig.machine().checkHoming(message.name); });
}
void take(const HomeAxesActionGoal& message) {
  MachineOnRig rig;
  rig.serve([&] { rig.machine().checkHoming(message.goal.name); });
}

// Those that have nothing that the machine could refuse.
void take(const Home::Request& /*message*/) {}
void take(const HomeActionGoal& /*message*/) {}
void take(const actionlib_msgs::GoalID& /*message*/) {}
void take(const sensor_msgs::Joy& /*message*/) {}
void take(const std_srvs::SetBool::Request& /*message*/) {}

template <typename M>
void readAndTake(const Bytes& bytes) {
  if (const auto message = readMessage<M>(bytes)) take(*message);
}

void readHeader(const Bytes& bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto header = ros_node::readHeader(text);
  if (!header) return;
  const std::string written = ros_node::headerBytes(*header);
  const auto again = ros_node::readHeader(std::string_view(written).substr(ros_node::kLengthBytes));
  require(again && *again == *header, "a header that is written is read as the same");
}

/// The conversation with a client of emergency_stop, as much at a time as the session takes.
void converse(const Bytes& bytes) {
  int calls = 0;
  const ros_node::TriggerServices services{
      {"/stepdriver/emergency_stop",
       [&calls](std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
         ++calls;
         response.success = 1U;
         return true;
       }}};
  ros_node::TriggerSession session(services);
  std::string_view left(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (std::size_t turns = 0; turns <= 2 * bytes.size() && !left.empty(); ++turns) {
    session.sent(session.output().size());
    const std::size_t wanted = session.wanted();
    require(wanted <= 16384, "a session takes a bounded part of a message");
    if (wanted == 0) break;
    const std::string_view part = left.substr(0, wanted);
    left.remove_prefix(part.size());
    session.receive(part);
  }
  require(calls == 0 || bytes.size() > 60, "no call is carried out without a header");
  require(static_cast<std::size_t>(calls) <= bytes.size() / ros_node::kLengthBytes,
          "each call has its own bytes");
}

using Reader = void (*)(const Bytes&);

const std::vector<Reader>& readers() {
  // A new one belongs to the end: the inputs of the corpus name them by their number.
  static const std::vector<Reader> all = {
      readAndTake<Jog>,
      readAndTake<trajectory_msgs::JointTrajectory>,
      readAndTake<ros_node::action_msgs::FollowJointTrajectoryActionGoal>,
      readAndTake<MoveTo::Request>,
      readAndTake<MoveActionGoal>,
      readAndTake<MoveRounds::Request>,
      readAndTake<Plan::Request>,
      readAndTake<Microstep::Request>,
      readAndTake<SetLimits::Request>,
      readAndTake<SetPosition::Request>,
      readAndTake<SpeedOverride::Request>,
      readAndTake<MoveLine::Request>,
      readAndTake<MoveLineActionGoal>,
      readAndTake<HomeAxes::Request>,
      readAndTake<HomeAxesActionGoal>,
      readAndTake<Home::Request>,
      readAndTake<HomeActionGoal>,
      readAndTake<actionlib_msgs::GoalID>,
      readAndTake<sensor_msgs::Joy>,
      readAndTake<std_srvs::SetBool::Request>,
      readHeader,
      converse,
      readAndTake<FollowPath::Request>,
      readAndTake<FollowPathActionGoal>,
      readAndTake<std_msgs::Float64MultiArray>,
  };
  return all;
}

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver::fuzz;
  if (size == 0) return 0;
  ros::Time::init();
  ros::Time::setNow(ros::Time(1'700'000'000, 0));
  const Bytes bytes(data + 1, data + size);
  readers()[data[0] % readers().size()](bytes);
  return 0;
}
