#pragma once

#include <sys/resource.h>

#include <csignal>

namespace stepdriver::test {

/// While it exists, no file of this process may grow beyond a size, as on a full disk: EFBIG.
class FullDisk {
 public:
  /// @param size [bytes] of any file; 0: every write fails.
  explicit FullDisk(rlim_t size) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit small = before_;
    small.rlim_cur = size;
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  void (*const handler_)(int);
  rlimit before_{};
};

}  // namespace stepdriver::test
