#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stepdriver::test {

/// The lines of gpiochip0 as a program with the library peer_lines sees them, in a file that it
/// shares with a test:
///
///     LD_PRELOAD=libpeer_lines.so STEPDRIVER_PEER_LINES=lines.bin klipper.elf -I /tmp/port
///
/// The program needs no GPIO then. Only the old interface of GPIO (uAPI 1, a line in each request)
/// is there.
struct PeerLines {
  static constexpr const char* kFileVariable = "STEPDRIVER_PEER_LINES";
  static constexpr std::size_t kLines = 288;

  std::array<std::atomic<std::uint64_t>, kLines> rises{};  ///< of outputs
  std::array<std::atomic<std::uint8_t>, kLines> levels{};  ///< of outputs and inputs
};

}  // namespace stepdriver::test
