#pragma once

#include <sys/types.h>

#include <string>

#include "injected/injected_faults.h"
#include "support/temporary_file.h"

namespace stepdriver::node_test {

/// Faults of the C library in each program that is started while this object lives. They can be
/// changed while the program runs.
class FaultInjection {
 public:
  FaultInjection();
  ~FaultInjection();
  FaultInjection(const FaultInjection&) = delete;
  FaultInjection& operator=(const FaultInjection&) = delete;

  InjectedFaults* operator->() const { return faults_; }
  InjectedFaults& all() const { return *faults_; }

  /// The calls that concern files below this path fail with the errors of the faults.
  void concern(const std::string& folder) const;

 private:
  const TemporaryFile file_;
  InjectedFaults* faults_ = nullptr;
};

}  // namespace stepdriver::node_test
