#include "probing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "message_text.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

void refuseBadProbing(const ProbeRequest& request) {
  const auto refuse_bad = [](const char* what, double value) {
    if (std::isfinite(value) && value >= 0.0) return;
    throw Refused(fmt::format(
        "the {} of the probing is {}, but must be a finite number above 0, or 0 for none", what,
        numberText(value)));
  };
  refuse_bad("second_velocity", request.second_velocity);
  refuse_bad("back_off", request.back_off);
  if (request.second_velocity > 0.0 && request.back_off == 0.0) {
    throw Refused("the second touch of the probing needs a back_off above 0");
  }
}

ProbeResult Probing::run() {
  if (!touchFirst()) return result_;
  try {
    if (request_.second_velocity > 0.0 && !touchAgain()) return result_;
    if (request_.returns && !goBack(result_.contact, "the way back to the contact")) return result_;
  } catch (const Error& error) {
    end(ProbeEnd::kFailed, error.what());
    return result_;
  }
  result_.succeeded = true;
  end(ProbeEnd::kContact,
      fmt::format("there was a contact at the input {}{}", request_.input,
                  result_.was_read
                      ? "; the kernel has reported no edge, so its place is where the axes "
                        "were when the input was read"
                      : ""));
  return result_;
}

bool Probing::touchFirst() {
  const ProbeStrokeResult touched = means_.touch(request_.positions, request_.velocity);
  begin_ = touched.begin;
  targets_ = touched.targets;
  return take(touched, "first");
}

bool Probing::touchAgain() {
  return goBack(placeBefore(), "the way back before the second touch") &&
         take(means_.touch(targets_, request_.second_velocity), "second");
}

bool Probing::take(const ProbeStrokeResult& touched, const char* which) {
  const bool is_second = !result_.contact.empty();
  result_.positions = touched.line.positions;
  result_.contact.clear();
  result_.was_read = false;
  if (touched.latched.latched) {
    result_.was_read = touched.latched.edge->was_read;
    for (const LatchedAxis& axis : touched.latched.edge->axes) {
      result_.contact.push_back(axis.position);
    }
    // At the end of the line it has come to rest by itself.
    const axis::MoveEnd ended = touched.line.end;
    if (ended == axis::MoveEnd::kStopped || ended == axis::MoveEnd::kReached) return true;
    end(ProbeEnd::kFailed, "after the contact: " + touched.line.message);
  } else if (touched.was_cancelled) {
    end(ProbeEnd::kCancelled, "it was cancelled: " + touched.line.message);
  } else if (touched.line.end == axis::MoveEnd::kReached) {
    result_.succeeded = !is_second && !request_.must;
    end(is_second ? ProbeEnd::kFailed : ProbeEnd::kNoContact,
        fmt::format("the {} touch met no contact at the input {}: {}", which, request_.input,
                    touched.line.message));
  } else {
    end(ProbeEnd::kFailed, touched.line.message);
  }
  return false;
}

bool Probing::goBack(const std::vector<double>& positions, const char* what) {
  const ProbeStrokeResult moved = means_.go_back(positions);
  result_.positions = moved.line.positions;
  if (moved.line.end == axis::MoveEnd::kReached) return true;
  end(moved.was_cancelled ? ProbeEnd::kCancelled : ProbeEnd::kFailed,
      fmt::format("{} has ended: {}", what, moved.line.message));
  return false;
}

// As far before the contact as the request says, but not before the beginning.
std::vector<double> Probing::placeBefore() const {
  double way = 0.0;
  for (std::size_t i = 0; i < begin_.size(); ++i) {
    way = std::hypot(way, result_.contact[i] - begin_[i]);
  }
  const double part = way > 0.0 ? std::min(1.0, request_.back_off / way) : 0.0;
  std::vector<double> place = result_.contact;
  for (std::size_t i = 0; i < place.size(); ++i) place[i] -= part * (place[i] - begin_[i]);
  return place;
}

void Probing::end(ProbeEnd end, const std::string& message) {
  result_.end = end;
  result_.message = message;
}

}  // namespace stepdriver::machine
