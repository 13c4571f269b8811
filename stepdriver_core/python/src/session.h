#pragma once

#include <pybind11/pybind11.h>
#include <sys/types.h>

#include <memory>
#include <mutex>
#include <utility>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/setup/hardware.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::python {

/// A machine that has no threads if the caller wants that: then the calls serve the pulses.
class ChosenMachine : public machine::Machine {
 public:
  ChosenMachine(const setup::MachineConfig& config, setup::Hardware& hardware, bool threaded)
      : Machine(config.axes, hardware.backend(), hardware.clock(), config.options(),
                threaded ? ServedBy::kThreads : ServedBy::kCallers) {}

  using Machine::advance;
};

/// A machine with its lines and its clock, as long as it is open.
class OpenMachine {
 public:
  /// @param threaded false: the calls serve the pulses, in virtual time.
  OpenMachine(const setup::MachineConfig& config, bool threaded);

  setup::Hardware& hardware() { return hardware_; }
  ChosenMachine& machine() { return machine_; }

  /// Held during a call. A machine without threads has only one caller at a time; a signal handler
  /// of Python may call it from within a call.
  std::unique_lock<std::recursive_mutex> turn();

  /// From now on it is never destroyed: in a process that has none of its threads.
  void leave(std::shared_ptr<OpenMachine> itself) { itself_ = std::move(itself); }

 private:
  const bool threaded_;
  std::shared_ptr<OpenMachine> itself_;
  setup::Hardware hardware_;
  ChosenMachine machine_;
  std::recursive_mutex mutex_;
};

/// The machine of a Python object. Its own state changes only with the global interpreter lock
/// (GIL), and everything that can wait happens without it: no thread of a machine needs the GIL.
///
/// A machine that is still open when the interpreter ends is shut down then. The child of a fork
/// has only one of the threads: it can't use the machine, and leaves it alone.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(const setup::MachineConfig& config, bool threaded);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Calls `work` with the open machine, without the GIL. It must not touch Python objects.
  ///
  /// @throw Refused if the machine was shut down, or in the child of a fork.
  template <typename Work>
  auto run(const Work& work) const {
    std::shared_ptr<OpenMachine> open = opened();
    const pybind11::gil_scoped_release without_gil;
    // The last call that uses a machine that was shut down also ends it.
    const std::shared_ptr<OpenMachine> used = std::move(open);
    const auto turn = used->turn();
    return work(*used);
  }

  bool isOpen() const { return open_ != nullptr; }
  bool isThreaded() const { return threaded_; }
  /// Decelerates, disables and releases the lines. Does nothing if that was done.
  ///
  /// @throw Error as machine::Machine::shutdown(); the lines are released.
  void close();

  /// Closes all that are open: when the interpreter ends.
  static void closeAll();

 private:
  bool isOwn() const;
  void release();
  const std::shared_ptr<OpenMachine>& opened() const;

  const pid_t process_;
  const bool threaded_;
  std::shared_ptr<OpenMachine> open_;
};

}  // namespace stepdriver::python
