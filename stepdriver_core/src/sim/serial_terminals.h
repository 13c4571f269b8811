#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

namespace stepdriver::sim {

/// Pseudo terminals in place of serial ports: what a program writes to one goes to a listener, and
/// the program reads what the listener returns.
class SerialTerminals {
 public:
  /// @param pause the wire was idle since the last bytes.
  using Listener = std::function<std::vector<std::uint8_t>(
      const std::string& port, const std::uint8_t* bytes, std::size_t count, bool pause)>;

  /// @throw Error if the system has no pseudo terminal left.
  SerialTerminals(const std::vector<std::string>& ports, Listener listener);
  ~SerialTerminals();
  SerialTerminals(const SerialTerminals&) = delete;
  SerialTerminals& operator=(const SerialTerminals&) = delete;

  /// The path of the terminal of a port; the port itself if it has none.
  std::string pathOf(const std::string& port) const;

 private:
  struct Terminal {
    int master = -1;
    int kept = -1;  // keeps the terminal alive between two programs
    std::string path;
    std::int64_t last_ns = 0;  // of the bytes that came last
  };

  void add(const std::string& port);
  void close();
  void run();
  void serve(const std::string& port, Terminal& terminal);

  std::map<std::string, Terminal> terminals_;
  const Listener listener_;
  int ending_[2] = {-1, -1};  // a pipe
  std::thread thread_;
};

}  // namespace stepdriver::sim
