#include "support/fault_injection.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace stepdriver::node_test {

FaultInjection::FaultInjection() : file_(".faults") {
  const int file = open(file_.path().c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0 || ftruncate(file, sizeof(InjectedFaults)) != 0) {
    throw std::runtime_error("no file for the faults");
  }
  void* memory = mmap(nullptr, sizeof(InjectedFaults), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) throw std::runtime_error("the faults can't be mapped");
  faults_ = static_cast<InjectedFaults*>(memory);
  faults_->threads_left = -1;
  faults_->allocations_left = -1;
  setenv(InjectedFaults::kFileVariable, file_.path().c_str(), 1);
  setenv("LD_PRELOAD", STEPDRIVER_INJECTED_LIBRARY, 1);
}

FaultInjection::~FaultInjection() {
  unsetenv("LD_PRELOAD");
  unsetenv(InjectedFaults::kFileVariable);
  munmap(faults_, sizeof(InjectedFaults));
}

void FaultInjection::concern(const std::string& folder) const {
  if (folder.size() >= sizeof faults_->folder) throw std::runtime_error("too long: " + folder);
  std::strncpy(faults_->folder, folder.c_str(), sizeof faults_->folder - 1);
}

}  // namespace stepdriver::node_test
