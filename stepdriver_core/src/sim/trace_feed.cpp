#include "trace_feed.h"

#include <algorithm>
#include <cstddef>

namespace stepdriver::sim {

int TraceFeed::addPin(const TracePin& pin, bool level) {
  pins_.push_back(pin);
  levels_.push_back(level);
  return static_cast<int>(pins_.size()) - 1;
}

void TraceFeed::addSwitch(const TracePin& pin, const SwitchModel* contact) {
  contacts_.push_back({contact, addPin(pin, contact->level(kForEver))});
}

bool TraceFeed::settling(std::int64_t time_ns) const {
  return !begun_ && (!start_ns_ || time_ns <= *start_ns_);
}

void TraceFeed::settle(int pin, bool level, std::int64_t time_ns) {
  if (!start_ns_) start_ns_ = time_ns;
  if (settling(time_ns)) {
    levels_[static_cast<std::size_t>(pin)] = level;
  } else {
    record(pin, level, time_ns);
  }
}

void TraceFeed::edge(int pin, bool level, std::int64_t time_ns) {
  if (!start_ns_) start_ns_ = time_ns;
  record(pin, level, time_ns);
}

void TraceFeed::advance(std::int64_t time_ns) {
  while (next_bounce_ns_ <= time_ns) switchesMoved(next_bounce_ns_);
}

void TraceFeed::switchesMoved(std::int64_t time_ns) {
  if (!trace_) return;
  next_bounce_ns_ = kNever;
  for (const Contact& contact : contacts_) {
    const bool level = contact.contact->level(time_ns);
    if (settling(time_ns)) {
      levels_[static_cast<std::size_t>(contact.pin)] = level;
    } else {
      record(contact.pin, level, time_ns);
    }
    next_bounce_ns_ = std::min(next_bounce_ns_, contact.contact->nextBounce(time_ns));
  }
}

void TraceFeed::finish(const std::vector<std::string>& summary) {
  advance(kNever - 1);
  if (!trace_ || !start_ns_) return;
  begin();
  for (const std::string& text : summary) trace_->summary(text);
}

void TraceFeed::flush() {
  if (!trace_) return;
  if (start_ns_) begin();
  trace_->flush();
}

void TraceFeed::begin() {
  if (begun_) return;
  begun_ = true;
  trace_->begin(pins_, levels_, *start_ns_);
}

void TraceFeed::record(int pin, bool level, std::int64_t time_ns) {
  if (!trace_ || levels_[static_cast<std::size_t>(pin)] == level) return;
  begin();
  levels_[static_cast<std::size_t>(pin)] = level;
  trace_->edge(pin, level, time_ns);
}

}  // namespace stepdriver::sim
