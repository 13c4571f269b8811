#pragma once

#include <mutex>
#include <optional>
#include <utility>

namespace stepdriver::axis {

/// How something ended that takes time: empty while it is under way, set once when it is over. Any
/// thread may read it, for as long as it keeps it.
template <typename Result>
class Outcome {
 public:
  std::optional<Result> get() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return result_;
  }

  /// The first result counts.
  void set(Result result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!result_) result_ = std::move(result);
  }

 private:
  mutable std::mutex mutex_;
  std::optional<Result> result_;
};

}  // namespace stepdriver::axis
