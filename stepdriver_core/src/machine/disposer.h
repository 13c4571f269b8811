#pragma once

#include <memory>
#include <utility>

namespace stepdriver::axis {

/// Frees what is long to free, a plan of hundreds of thousands of points, say, in a thread of its
/// own with a low priority: never in the thread that happens to be the last to use it.
///
/// The thread starts with the first object that is kept. Handing over is lock-free and doesn't
/// allocate. All calls are safe from any thread.
class Disposer {
 public:
  /// @param threaded else everything is freed at once.
  explicit Disposer(bool threaded);
  /// Frees what is left. What is still in use is freed by its last user from then on.
  ~Disposer();
  Disposer(const Disposer&) = delete;
  Disposer& operator=(const Disposer&) = delete;

  /// @return the same object; when the last user of it is done, it is handed over.
  /// @param owned has no other users.
  template <typename T>
  std::shared_ptr<const T> keep(std::shared_ptr<const T> owned) {
    const T* object = owned.get();
    return {keepAny(std::move(owned)), object};
  }

 private:
  class Queue;

  std::shared_ptr<const void> keepAny(std::shared_ptr<const void> owned);

  std::shared_ptr<Queue> queue_;
};

}  // namespace stepdriver::axis
