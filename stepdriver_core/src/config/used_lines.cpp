#include "config/used_lines.h"

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
  const auto name = [](bool level) { return std::string(level ? "high" : "low"); };
  issues_.push_back({key, "is \"" + line + "\", which is " + user.key +
                              " too, but its axis is enabled by " + name(*on) +
                              " and the other by " + name(*user.on) +
                              "; axes that share a line need the same level"});
}

void UsedLines::refuse(const std::string& key, const std::string& line, const User& user) {
  issues_.push_back({key, "is \"" + line + "\", which is used twice: it is " + user.key +
                              " already, and each pin needs a line of its own"});
}

}  // namespace stepdriver::config
