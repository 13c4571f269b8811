#pragma once

#include <string>

#include "byte_stream.h"

namespace stepdriver::bus {

/// A serial port of this computer: 8N1, without any treatment of the bytes. No other program can
/// use it meanwhile.
class SerialPort : public ByteStream {
 public:
  /// @throw PortError if the port can't be opened, is in use, or doesn't have that rate.
  SerialPort(std::string path, int baud);
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  void send(const std::uint8_t* bytes, std::size_t count) override;
  std::size_t receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout_ns) override;

 private:
  /// Waits for an event of poll(). @return whether it came within this time.
  bool await(short event, std::int64_t timeout_ns) const;
  [[noreturn]] void lost(const std::string& what) const;
  void setUp(int baud) const;

  const std::string path_;
  int file_ = -1;
};

}  // namespace stepdriver::bus
