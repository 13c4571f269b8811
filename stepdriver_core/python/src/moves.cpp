#include "moves.h"

#include "requests.h"
#include "wait_time.h"

namespace stepdriver::python {
namespace py = pybind11;

std::optional<axis::MoveResult> MoveHandle::result() const {
  if (!session_->isOpen()) return move_.outcome->get();
  return session_->run(
      [this](OpenMachine& open) { return open.machine().axis(axis_).result(move_); });
}

// Without a bound the machine notices if nothing can end the wait.
std::optional<axis::MoveResult> MoveHandle::wait(std::optional<double> longest) const {
  if (!session_->isOpen()) return move_.outcome->get();
  return session_->run([this, time = waitTimeOf(longest)](OpenMachine& open) {
    return open.machine().axis(axis_).waitFor(move_, time);
  });
}

void MoveHandle::stop() const {
  session_->run([this](OpenMachine& open) { open.machine().axis(axis_).stop(move_); });
}

std::optional<machine::CoordinatedResult> CoordinatedMoveHandle::result() const {
  if (session_->isOpen()) {
    return session_->run([this](OpenMachine& open) { return open.machine().result(move_); });
  }
  std::vector<axis::MoveResult> results;
  for (const machine::CoordinatedMove::Member& member : move_.members) {
    const auto own = member.move.outcome->get();
    if (!own) return std::nullopt;
    results.push_back(*own);
  }
  return machine::combinedResult(results);
}

std::optional<machine::CoordinatedResult> CoordinatedMoveHandle::wait(
    std::optional<double> longest) const {
  if (!session_->isOpen()) return result();
  return session_->run([this, time = waitTimeOf(longest)](OpenMachine& open) {
    return open.machine().waitFor(move_, time);
  });
}

void CoordinatedMoveHandle::stop() const {
  session_->run([this](OpenMachine& open) { open.machine().stop(move_); });
}

std::vector<std::string> CoordinatedMoveHandle::names() const {
  std::vector<std::string> names;
  for (const machine::CoordinatedMove::Member& member : move_.members) names.push_back(member.axis);
  return names;
}

motion::PathAhead CoordinatedMoveHandle::append(const py::iterable& segments,
                                                bool more_follows) const {
  const motion::PathAppend request{move_.id(), segmentsOf(segments, names()), more_follows};
  return session_->run([&](OpenMachine& open) { return open.machine().appendPath(request); });
}

std::optional<motion::PathAhead> CoordinatedMoveHandle::ahead() const {
  return session_->run([this](OpenMachine& open) { return open.machine().pathAhead(move_.id()); });
}

}  // namespace stepdriver::python
