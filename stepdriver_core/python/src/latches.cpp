#include "latches.h"

#include "wait_time.h"

namespace stepdriver::python {

// Without a bound the machine notices if nothing can end the wait.
std::optional<machine::LatchResult> LatchHandle::wait(std::optional<double> longest) const {
  if (!session_->isOpen()) return result();
  return session_->run([this, time = waitTimeOf(longest)](OpenMachine& open) {
    return open.machine().waitFor(latch_, time);
  });
}

void LatchHandle::end() const {
  if (!session_->isOpen()) return;
  session_->run([this](OpenMachine& open) { open.machine().end(latch_); });
}

}  // namespace stepdriver::python
