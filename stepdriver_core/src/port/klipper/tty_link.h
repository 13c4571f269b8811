#pragma once

#include <string>

#include "port/klipper/link.h"

namespace stepdriver::klipper {

/// A board at a serial port of this computer: 8N1, without any treatment of the bytes. No other
/// program that asks can use the port meanwhile.
class TtyLink : public Link {
 public:
  /// @param board its name, for messages. @param baud of ports that aren't USB.
  /// @throw BoardError if the port can't be opened, is in use, or doesn't have that rate.
  TtyLink(const std::string& board, const std::string& path, int baud);
  ~TtyLink() override;
  TtyLink(const TtyLink&) = delete;
  TtyLink& operator=(const TtyLink&) = delete;

  std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override;
  std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override;
  void await(pulse::Nanoseconds timeout) override;

 private:
  int file_ = -1;
};

}  // namespace stepdriver::klipper
