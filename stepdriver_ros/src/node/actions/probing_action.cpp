#include "probing_action.h"

#include <chrono>
#include <exception>

#include "node/probe_request.h"
#include "node/refusal_log.h"

namespace stepdriver::ros_node {
namespace {

using Steady = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPositionsPeriod{100};

int numberOf(machine::ProbeEnd end) {
  switch (end) {
    case machine::ProbeEnd::kContact:
      return ProbeResult::CONTACT;
    case machine::ProbeEnd::kNoContact:
      return ProbeResult::NO_CONTACT;
    case machine::ProbeEnd::kCancelled:
      return ProbeResult::CANCELLED;
    case machine::ProbeEnd::kFailed:
      break;
  }
  return ProbeResult::FAILED;
}

}  // namespace

ProbingAction::ProbingAction(const ros::NodeHandle& node, machine::Machine& machine,
                             ActionTopics& topics)
    : machine_(machine), goals_(node, "probe", topics, [this](auto& goal, const auto& cancelled) {
        probe(goal, cancelled);
      }) {}

ProbingAction::~ProbingAction() = default;

void ProbingAction::probe(Goals::GoalHandle& handle, const std::function<bool()>& cancelled) {
  const auto goal = handle.getGoal();
  Steady::time_point told;
  ProbeResult answer;
  answer.end = ProbeResult::REFUSED;
  bool succeeded = false;
  try {
    const machine::ProbeResult result = machine_.probe(probeRequest(*goal), [&] {
      if (Steady::now() >= told + kPositionsPeriod) {
        told = Steady::now();
        ProbeFeedback feedback;
        for (const std::string& name : goal->name) {
          feedback.position.push_back(machine_.axis(name).state().position);
        }
        handle.publishFeedback(feedback);
      }
      return cancelled();
    });
    succeeded = result.succeeded;
    answer.end = numberOf(result.end);
    answer.message = result.message;
    answer.contact_position = result.contact;
    answer.contact_was_read = result.was_read;
    answer.position = result.positions;
  } catch (const std::exception& error) {
    answer.message = error.what();
    logRefusal(answer.message);
  }
  if (succeeded) {
    handle.setSucceeded(answer, answer.message);
  } else if (answer.end == ProbeResult::CANCELLED) {
    handle.setCanceled(answer, answer.message);
  } else {
    handle.setAborted(answer, answer.message);
  }
}

}  // namespace stepdriver::ros_node
