#include "config/used_lines.h"

#include <fmt/format.h>

namespace stepdriver::config {

void UsedLines::add(const std::string& key, const std::string& line) {
  const auto [user, is_new] = users_.emplace(line, User{key});
  if (!is_new) refuse(key, line, user->second);
}

void UsedLines::addEnable(const std::string& key, const std::string& line, std::optional<bool> on) {
  const auto [found, is_new] = users_.emplace(line, User{key, true, on});
  if (is_new) return;
  const User& user = found->second;
  if (!user.enables) return refuse(key, line, user);
  if (!on || !user.on || *on == *user.on) return;
  const auto name = [](bool level) { return level ? "high" : "low"; };
  issues_.push_back({key,
                     fmt::format("is \"{}\", which is {} too, but its axis is enabled by {} "
                                 "and the other by {}; axes that share a line need the same level",
                                 line, user.key, name(*on), name(*user.on)),
                     true});
}

void UsedLines::addShared(const std::string& key, const Endstop& endstop) {
  const auto [found, is_new] =
      users_.emplace(endstop.line, User{key, false, std::nullopt, endstop});
  if (is_new) return;
  const User& user = found->second;
  if (!user.shared) return refuse(key, endstop.line, user);
  if (user.shared->active_level == endstop.active_level && user.shared->bias == endstop.bias) {
    return;
  }
  issues_.push_back({key,
                     fmt::format("is \"{}\", which is {} too; switches that share a line need the "
                                 "same active_level and bias",
                                 endstop.line, user.key),
                     true});
}

void UsedLines::refuse(const std::string& key, const std::string& line, const User& user) {
  issues_.push_back({key,
                     fmt::format("is \"{}\", which is used twice: it is {} already, "
                                 "and each pin needs a line of its own{}",
                                 line, user.key,
                                 user.shared ? ", unless both are switches with shared: true" : ""),
                     true});
}

}  // namespace stepdriver::config
