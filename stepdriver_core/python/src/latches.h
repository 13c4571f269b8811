#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "session.h"
#include "stepdriver_core/machine/io.h"

namespace stepdriver::python {

/// A latch that a machine has accepted, and that keeps it. When the machine was shut down, the
/// latch still has its edges and its result.
class LatchHandle {
 public:
  LatchHandle(std::shared_ptr<Session> session, machine::Latch latch)
      : session_(std::move(session)), latch_(std::move(latch)) {}

  /// The edges since the last call.
  std::vector<machine::LatchedEdge> take() const { return latch_.record->take(); }
  std::optional<machine::LatchResult> result() const { return latch_.record->result(); }
  /// @param longest [s] Empty: as long as it takes.
  std::optional<machine::LatchResult> wait(std::optional<double> longest) const;
  /// Does nothing if it has ended.
  void end() const;

 private:
  std::shared_ptr<Session> session_;
  machine::Latch latch_;
};

}  // namespace stepdriver::python
