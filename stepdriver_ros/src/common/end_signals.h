#pragma once

#include <array>
#include <csignal>

namespace stepdriver::ros_node {

struct EndSignal {
  int number;
  const char* name;
};

constexpr std::array<EndSignal, 4> kEndSignals{
    {{SIGINT, "SIGINT"}, {SIGTERM, "SIGTERM"}, {SIGQUIT, "SIGQUIT"}, {SIGHUP, "SIGHUP"}}};

/// The signals that ask a program to end. SIGHUP, which a closed terminal sends, counts only if it
/// isn't ignored (nohup).
inline sigset_t endSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  struct sigaction hangup {};
  const bool ignored = sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler == SIG_IGN;
  for (const EndSignal& signal : kEndSignals) {
    if (signal.number != SIGHUP || !ignored) sigaddset(&signals, signal.number);
  }
  return signals;
}

}  // namespace stepdriver::ros_node
