#include "bus_threads.h"

#include <pthread.h>

#include <utility>

#include "start_thread.h"

namespace stepdriver::bus {

BusThreads::BusThreads(Open open, bool threaded, std::function<void()> told)
    : open_(std::move(open)), threaded_(threaded), told_(std::move(told)) {}

BusThreads::~BusThreads() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
    for (const auto& [name, port] : ports_) port->changed.notify_all();
  }
  for (const auto& [name, port] : ports_) {
    if (port->thread.joinable()) port->thread.join();
  }
}

bool BusThreads::isEnding() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return ending_;
}

void BusThreads::begin(RegisterJob job) {
  std::unique_lock<std::mutex> lock(mutex_);
  std::unique_ptr<Port>& port = ports_[job.port];
  if (port == nullptr) port = std::make_unique<Port>();
  ++under_way_;
  if (threaded_ && !port->thread.joinable()) {
    try {
      port->thread = startThread([this, &own = *port] { run(own); });
    } catch (const ExhaustedError& error) {
      RegisterDone done;
      done.id = job.id;
      done.failure = Failure::kPort;
      done.port_error = error.what();
      done_.push_back(std::move(done));
      lock.unlock();
      return told_();
    }
  }
  if (threaded_) {
    port->jobs.push_back(std::move(job));
    port->changed.notify_all();
    return;
  }
  lock.unlock();
  RegisterDone done = carryOutOn(*port, job);
  lock.lock();
  done_.push_back(std::move(done));
  lock.unlock();
  told_();
}

void BusThreads::run(Port& port) {
  pthread_setname_np(pthread_self(), "driver bus");
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    port.changed.wait(lock, [this, &port] { return ending_ || !port.jobs.empty(); });
    if (ending_) return;
    const RegisterJob job = std::move(port.jobs.front());
    port.jobs.pop_front();
    lock.unlock();
    RegisterDone done = carryOutOn(port, job);
    lock.lock();
    done_.push_back(std::move(done));
    lock.unlock();
    told_();
    lock.lock();
  }
}

// A port that has failed is opened again by the next job: its adapter may be back.
RegisterDone BusThreads::carryOutOn(Port& port, const RegisterJob& job) {
  try {
    if (port.registers == nullptr) port.registers = open_(job.port, job.baud);
    return carryOut(job, *port.registers, [this] { return isEnding(); });
  } catch (const PortError& error) {
    port.registers.reset();
    RegisterDone done;
    done.id = job.id;
    done.failure = Failure::kPort;
    done.port_error = error.what();
    return done;
  }
}

std::vector<RegisterDone> BusThreads::collect() {
  const std::lock_guard<std::mutex> lock(mutex_);
  under_way_ -= done_.size();
  return std::exchange(done_, {});
}

bool BusThreads::idle() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return under_way_ == 0;
}

}  // namespace stepdriver::bus
