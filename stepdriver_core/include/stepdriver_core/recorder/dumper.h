#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "stepdriver_core/machine/machine.h"

/// The files of the flight recorder.
namespace stepdriver::recorder {

/// The folder for the recordings of a machine, and when they are written.
struct DumperOptions {
  /// Made if it doesn't exist, with the folders above it.
  std::string folder;
  /// Of the machine: the files' names begin with it. Letters, digits, `_` and `-`.
  std::string name = "stepdriver";
  int keep = 20;  ///< recordings of this name in the folder; the oldest ones are removed
  /// After a recording of a fault, the next one of a fault comes no sooner than this.
  std::chrono::milliseconds fault_pause{10'000};
  /// The same for recordings on request, after any recording.
  std::chrono::milliseconds request_pause{1'000};
};

/// A recording that was written, or should have been.
struct Dump {
  std::string reason;  ///< `fault`, or as requested
  std::string trace;   ///< path of the VCD file
  std::string events;  ///< path of the text
  std::string error;   ///< why there are no files; empty: there are
};

/// Writes what a machine has recorded to files, in a thread of its own: at each fault, and on
/// request. The machine never waits for it.
///
/// A recording is two files that belong together: the edges of all outputs as VCD, and the events
/// as text. Both have the same zero. If they can't be written, neither is left.
///
/// @code{.cpp}
/// recorder::Dumper dumper(machine, {"/var/log/stepdriver", "plotter"});
/// const recorder::Dump dump = dumper.dump("the sheet has slipped");
/// std::cout << (dump.error.empty() ? dump.trace : dump.error) << "\n";
/// @endcode
class Dumper {
 public:
  /// @param machine outlives the dumper. It records.
  /// @param told called after each recording, in the dumper's thread; may be empty.
  Dumper(machine::Machine& machine, DumperOptions options,
         std::function<void(const Dump&)> told = {});
  /// Writes what was requested, and the last fault.
  ~Dumper();
  Dumper(const Dumper&) = delete;
  Dumper& operator=(const Dumper&) = delete;

  /// Requests a recording, and returns at once.
  void request(const std::string& reason);

  /// Requests a recording, and waits for it. Requests that wait at the same time get the same one.
  Dump dump(const std::string& reason);

  /// Why the last recording couldn't be written; empty: it was, or there was none.
  std::string error() const;
  /// The last one that was written; without a reason: none.
  Dump last() const;

 private:
  using Time = std::chrono::steady_clock::time_point;

  void run();
  /// When the next recording is due; the largest time: nobody wants one.
  Time due() const;
  void write(std::unique_lock<std::mutex>& lock);

  machine::Machine& machine_;
  const DumperOptions options_;
  const std::function<void(const Dump&)> told_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  bool fault_ = false;
  std::string requested_;  // the reason of the first request; empty: no request
  Time next_fault_ = Time::min();
  Time next_request_ = Time::min();
  std::uint64_t asked_ = 0;  // recordings that began or will begin because of a request
  std::uint64_t done_ = 0;   // requests up to this one are done
  Dump latest_;
  Dump last_;
  std::string error_;
  std::thread thread_;
};

}  // namespace stepdriver::recorder
