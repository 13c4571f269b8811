#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "session.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::python {

/// A motion that a machine has accepted, and that keeps it. When the machine was shut down, the
/// motion still has its result.
class MoveHandle {
 public:
  MoveHandle(std::shared_ptr<Session> session, std::string axis, axis::Move move)
      : session_(std::move(session)), axis_(std::move(axis)), move_(std::move(move)) {}

  const axis::Move& move() const { return move_; }
  std::optional<axis::MoveResult> result() const;
  /// @param longest [s] Empty: as long as it takes.
  std::optional<axis::MoveResult> wait(std::optional<double> longest) const;
  void stop() const;

 private:
  std::shared_ptr<Session> session_;
  std::string axis_;
  axis::Move move_;
};

/// The same of several axes.
class CoordinatedMoveHandle {
 public:
  CoordinatedMoveHandle(std::shared_ptr<Session> session, machine::CoordinatedMove move)
      : session_(std::move(session)), move_(std::move(move)) {}

  const machine::CoordinatedMove& move() const { return move_; }
  std::optional<machine::CoordinatedResult> result() const;
  std::optional<machine::CoordinatedResult> wait(std::optional<double> longest) const;
  void stop() const;

  motion::PathAhead append(const pybind11::iterable& segments, bool more_follows) const;
  std::optional<motion::PathAhead> ahead() const;

 private:
  std::vector<std::string> names() const;

  std::shared_ptr<Session> session_;
  machine::CoordinatedMove move_;
};

}  // namespace stepdriver::python
