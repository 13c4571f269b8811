#include "refusal_log.h"

#include <ros/console.h>

#include <algorithm>
#include <cctype>

namespace stepdriver::ros_node {
namespace {

const ros::WallDuration kSayPeriod(1.0);

std::string withoutNumbers(std::string text) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  text.erase(std::remove_if(text.begin(), text.end(), is_digit), text.end());
  return text;
}

}  // namespace

void RefusalLog::warn(const std::string& reason) {
  const ros::SteadyTime now = ros::SteadyTime::now();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto entry = said_.begin(); entry != said_.end();) {
      entry = now - entry->second >= kSayPeriod ? said_.erase(entry) : std::next(entry);
    }
    if (!said_.emplace(withoutNumbers(reason), now).second) return;
  }
  ROS_WARN_NAMED("trajectory", "%s: %s", source_.c_str(), reason.c_str());
}

}  // namespace stepdriver::ros_node
