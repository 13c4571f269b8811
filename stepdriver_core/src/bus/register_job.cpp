#include "register_job.h"

namespace stepdriver::bus {
namespace {

constexpr int kRuns = 3;

/// One access, whose value is added to the results.
Failure carryOut(const RegisterAccess& access, RegisterPort& port, RegisterDone& done) {
  using Kind = RegisterAccess::Kind;
  std::uint32_t value = access.value;
  Failure failure = Failure::kNone;
  switch (access.kind) {
    case Kind::kUnchecked:
      port.writeUnchecked(access.address, access.number, access.value);
      break;
    case Kind::kWrite:
      failure = port.write(access.address, access.number, access.value);
      break;
    case Kind::kWriteBack:
      failure = port.write(access.address, access.number, access.value);
      if (failure == Failure::kNone) failure = port.read(access.address, access.number, 0, value);
      if (failure == Failure::kNone && value != access.value) failure = Failure::kMismatch;
      break;
    case Kind::kRead:
      failure = port.read(access.address, access.number, access.mask, value);
      break;
    case Kind::kSample:
      failure = port.sample(access.address, access.number, value);
      break;
    case Kind::kExpect:
      failure = port.read(access.address, access.number, ~access.mask, value);
      if (failure == Failure::kNone && ((value ^ access.value) & access.mask) != 0) {
        failure = Failure::kMismatch;
      }
      break;
  }
  done.found = value;
  if (failure == Failure::kNone) done.values.push_back(value);
  return failure;
}

}  // namespace

RegisterDone carryOut(const RegisterJob& job, RegisterPort& port,
                      const std::function<bool()>& ends) {
  RegisterDone done;
  done.id = job.id;
  const std::uint64_t transactions = port.transactions();
  const std::uint64_t retries = port.retries();
  for (int run = 0; run < kRuns; ++run) {
    done.values.clear();
    done.failure = Failure::kNone;
    for (std::size_t i = 0; i < job.accesses.size() && done.failure == Failure::kNone; ++i) {
      if (ends && ends()) {
        done.failure = Failure::kPort;
        done.port_error = "the machine was shut down";
        return done;
      }
      done.failed_number = job.accesses[i].number;
      done.failure = carryOut(job.accesses[i], port, done);
    }
    if (done.failure != Failure::kStray || !job.writes_all) break;
  }
  done.transactions = port.transactions() - transactions;
  done.retries = port.retries() - retries;
  return done;
}

}  // namespace stepdriver::bus
