#include "storm/request_log.h"

#include <chrono>
#include <utility>

namespace stepdriver::storm {

std::int64_t steadyNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::size_t RequestLog::begin(Request request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  request.sent = steadyNow();
  requests_.push_back(std::move(request));
  return requests_.size() - 1;
}

void RequestLog::end(std::size_t index, bool success, std::string message, Answer answer) {
  const std::int64_t now = steadyNow();
  const std::lock_guard<std::mutex> lock(mutex_);
  Request& request = requests_.at(index);
  request.answered = now;
  request.success = success;
  request.message = std::move(message);
  request.answer = std::move(answer);
}

std::vector<Request> RequestLog::requests() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return requests_;
}

std::size_t RequestLog::count() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return requests_.size();
}

}  // namespace stepdriver::storm
