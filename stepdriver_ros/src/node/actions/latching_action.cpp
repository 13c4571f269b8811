#include "latching_action.h"

#include "node/latch_request.h"

namespace stepdriver::ros_node {
namespace {

constexpr int kEdgesQueueSize = 1000;

}  // namespace

LatchingAction::LatchingAction(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                               ActionTopics& topics, const MachineTime& time)
    : MotionAction(onQueue(queues.control(), node), "latch", topics, [this] { poll_.begin(); }),
      machine_(machine),
      time_(time),
      publisher_(node.advertise<LatchedPositions>("latched_positions", kEdgesQueueSize)),
      poll_(onQueue(queues.control(), node), kPollPeriod, [this] { return this->poll(); }) {
  start();
}

LatchingAction::~LatchingAction() = default;

Latching LatchingAction::begin(const GoalHandle& handle) {
  Latching latching;
  latching.handle = handle;
  latching.latch = machine_.latch(latchRequest(*handle.getGoal()));
  return latching;
}

void LatchingAction::reject(GoalHandle& handle, const Error& error) {
  LatchResult result;
  result.message = error.what();
  handle.setRejected(result, result.message);
}

void LatchingAction::stop(const Latching& latching) { machine_.end(latching.latch); }

bool LatchingAction::conclude(Latching& latching) {
  const auto ended = latching.latch.record->result();
  if (!ended) return false;
  publishEdges(latching);
  LatchResult result;
  result.latched = ended->latched;
  result.message = ended->message;
  result.edges = ended->edges;
  if (ended->edge) result.last = messageOf(latching, *ended->edge);
  const bool first_only = latching.handle.getGoal()->every == 0;
  if (first_only && ended->latched) {
    latching.handle.setSucceeded(result, result.message);
  } else if (!latching.preempted_by.empty()) {
    latching.handle.setCanceled(result, result.message);
  } else {
    latching.handle.setAborted(result, result.message);
  }
  return true;
}

void LatchingAction::watch(Latching& latching, bool tell) {
  publishEdges(latching);
  if (!tell) return;
  LatchFeedback feedback;
  feedback.edges = latching.edges;
  latching.handle.publishFeedback(feedback);
}

void LatchingAction::publishEdges(Latching& latching) {
  for (const machine::LatchedEdge& edge : latching.latch.record->take()) {
    latching.edges = edge.number;
    publisher_.publish(messageOf(latching, edge));
  }
}

LatchedPositions LatchingAction::messageOf(const Latching& latching,
                                           const machine::LatchedEdge& edge) const {
  LatchedPositions message;
  message.header.stamp = time_.at(edge.time, time_.now());
  message.goal = latching.handle.getGoalID().id;
  message.input = latching.handle.getGoal()->input;
  message.number = edge.number;
  message.active = edge.active;
  message.was_read = edge.was_read;
  for (const machine::LatchedAxis& axis : edge.axes) {
    message.name.push_back(axis.name);
    message.position.push_back(axis.position);
    message.position_valid.push_back(axis.position_valid);
  }
  return message;
}

}  // namespace stepdriver::ros_node
