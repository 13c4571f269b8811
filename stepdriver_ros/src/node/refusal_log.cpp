#include "refusal_log.h"

#include <ros/console.h>

#include <algorithm>
#include <cctype>

namespace stepdriver::ros_node {
namespace {

const ros::WallDuration kSayPeriod(1.0);

std::string withoutNumbers(std::string text) {
  const auto is_of_number = [](unsigned char c) {
    return std::isdigit(c) != 0 || c == '.' || c == '-';
  };
  text.erase(std::remove_if(text.begin(), text.end(), is_of_number), text.end());
  return text;
}

}  // namespace

bool RefusalLog::isDue(const std::string& reason) {
  const ros::SteadyTime now = ros::SteadyTime::now();
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto entry = said_.begin(); entry != said_.end();) {
    entry = now - entry->second >= kSayPeriod ? said_.erase(entry) : std::next(entry);
  }
  return said_.emplace(withoutNumbers(reason), now).second;
}

void logRefusal(const std::string& reason) {
  static RefusalLog log;
  if (log.isDue(reason)) ROS_WARN_NAMED("refused", "Refused: %s", reason.c_str());
}

}  // namespace stepdriver::ros_node
