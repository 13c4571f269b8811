#pragma once

#include <cstddef>
#include <exception>
#include <functional>
#include <thread>
#include <utility>

namespace stepdriver {

/// Thrown by giveWay() in a thread that no longer wants the result of its loop.
class Interrupted : public std::exception {
 public:
  const char* what() const noexcept override { return "interrupted"; }
};

/// While it exists, the long loops of its thread end with Interrupted as soon as a condition is
/// true: a path of 300,000 segments is planned for seconds, and a stop must not wait for that.
///
///     const Interruptible planning([&] { return engine.stopsAsked() != asked; });
///     plan = planPath(request, facts, origins);
class Interruptible {
 public:
  /// @param wanted is called often, so it is fast and doesn't wait.
  explicit Interruptible(std::function<bool()> wanted)
      : wanted_(std::move(wanted)), before_(std::exchange(current(), this)) {}
  ~Interruptible() { current() = before_; }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  /// @throw Interrupted if any of those of this thread wants it.
  static void check() {
    for (const Interruptible* each = current(); each != nullptr; each = each->before_) {
      if (each->wanted_()) throw Interrupted();
    }
  }

 private:
  static const Interruptible*& current() {
    thread_local const Interruptible* of_this_thread = nullptr;
    return of_this_thread;
  }

  const std::function<bool()> wanted_;
  const Interruptible* const before_;
};

/// Lets other threads run in the middle of a long loop. Call it with the index of each item.
///
/// If all processors are busy, a thread that wakes up may have to wait for the next tick of the
/// scheduler, 4 ms at 250 Hz. A stop that comes while long trajectories are prepared must not.
///
/// @throw Interrupted, see Interruptible.
inline void giveWay(std::size_t index) {
  constexpr std::size_t kEvery = 64;  // items: about 0.1 ms of planning
  if (index % kEvery != kEvery - 1) return;
  std::this_thread::yield();
  Interruptible::check();
}

/// The same for items that take a fraction of that: the places of a path, the points of a
/// trajectory.
inline void giveWayAt(std::size_t place) {
  constexpr std::size_t kPlaces = 8;  // as long as an item
  if (place % kPlaces == 0) giveWay(place / kPlaces);
}

}  // namespace stepdriver
