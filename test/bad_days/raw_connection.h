#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace stepdriver::bad_days {

/// A connection to a port of this computer that never waits, for clients that keep no rules. It is
/// reset at its end.
class RawConnection {
 public:
  /// @param receive_buffer of the socket, in bytes; 0: the system's default.
  explicit RawConnection(std::uint16_t port, int receive_buffer = 0);
  ~RawConnection();
  RawConnection(RawConnection&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}
  RawConnection& operator=(RawConnection&& other) noexcept {
    std::swap(socket_, other.socket_);
    return *this;
  }

  /// Sends as much as possible now.
  /// @return the number of bytes that were sent.
  std::size_t send(const std::string& bytes) const;
  /// Whether the other end has closed or reset it. Nothing must have been received.
  bool isOver() const;

 private:
  int socket_;
};

/// Lets this process open as many connections as it may.
void raiseDescriptorLimit();

}  // namespace stepdriver::bad_days
