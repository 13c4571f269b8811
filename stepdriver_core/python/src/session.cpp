#include "session.h"

#include <unistd.h>

#include <set>
#include <vector>

namespace stepdriver::python {
namespace {

namespace py = pybind11;

// The sessions of this process, which the GIL protects.
std::set<Session*>& sessions() {
  static auto* const all = new std::set<Session*>;  // is used until the process ends
  return *all;
}

std::shared_ptr<OpenMachine> open(const setup::MachineConfig& config, bool threaded) {
  const py::gil_scoped_release without_gil;
  return std::make_shared<OpenMachine>(config, threaded);
}

}  // namespace

OpenMachine::OpenMachine(const setup::MachineConfig& config, bool threaded)
    : threaded_(threaded), hardware_(config), machine_(config, hardware_, threaded) {}

std::unique_lock<std::recursive_mutex> OpenMachine::turn() {
  std::unique_lock<std::recursive_mutex> lock(mutex_, std::defer_lock);
  if (!threaded_) lock.lock();
  return lock;
}

Session::Session(const setup::MachineConfig& config, bool threaded)
    : process_(getpid()), threaded_(threaded), open_(open(config, threaded)) {
  sessions().insert(this);
}

Session::~Session() {
  sessions().erase(this);
  if (open_ == nullptr) return;
  if (!isOwn()) {
    // To join its threads would take forever, and the other process has the lines.
    OpenMachine& left = *open_;
    left.leave(std::move(open_));
    return;
  }
  release();
}

void Session::release() {
  std::shared_ptr<OpenMachine> open = std::move(open_);
  const py::gil_scoped_release without_gil;
  open.reset();
}

bool Session::isOwn() const { return getpid() == process_; }

const std::shared_ptr<OpenMachine>& Session::opened() const {
  if (!isOwn()) {
    throw Refused(
        "the machine belongs to the process that made it, and this one was forked from that: make "
        "a "
        "machine here, or start the process by multiprocessing's method spawn");
  }
  if (open_ == nullptr) throw Refused("the machine was shut down");
  return open_;
}

void Session::close() {
  if (open_ == nullptr) return;
  if (!isOwn()) return;
  const auto shut_down = [](OpenMachine& open) { open.machine().shutdown(); };
  try {
    run(shut_down);
  } catch (const Error&) {
    release();
    throw;
  }
  release();
}

void Session::closeAll() {
  std::vector<std::shared_ptr<Session>> all;
  for (Session* session : sessions()) {
    if (auto shared = session->weak_from_this().lock()) all.push_back(std::move(shared));
  }
  for (const auto& session : all) {
    try {
      session->close();
    } catch (const Error& error) {
      py::print(error.what(), py::arg("file") = py::module_::import("sys").attr("stderr"));
    }
  }
}

}  // namespace stepdriver::python
