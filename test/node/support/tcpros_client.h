#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace stepdriver::node_test {

/// The address of a service, according to the master. The test fails if the master has none.
std::string serviceUri(const std::string& service);
/// The port of that address.
std::uint16_t servicePort(const std::string& service);

/// A client of services that can send arbitrary bytes. Each of its waits is bounded.
class TcprosClient {
 public:
  using Header = std::map<std::string, std::string>;

  /// Connects to the address of the service.
  ///
  /// @param receive_buffer of the socket, in bytes; 0: the system's default.
  explicit TcprosClient(const std::string& service, int receive_buffer = 0)
      : TcprosClient(servicePort(service), receive_buffer) {}
  /// Connects to a port of this computer, without a question to the master.
  explicit TcprosClient(std::uint16_t port, int receive_buffer = 0);
  ~TcprosClient();
  TcprosClient(const TcprosClient&) = delete;
  TcprosClient& operator=(const TcprosClient&) = delete;

  /// Lets the connection be reset at its end. The system then keeps no trace of it, and thousands
  /// may come and go each second.
  void resetAtEnd() const;

  /// @return whether all of it was sent.
  bool send(const std::string& bytes) const;
  /// Sends as much as possible without waiting.
  /// @return the number of bytes that were sent.
  std::size_t sendAtOnce(const std::string& bytes) const;
  /// @return this many bytes; fewer if the connection is closed or no more come.
  std::string receive(std::size_t bytes) const;
  /// @return the fields of a header; no value if none comes.
  Header receiveHeader() const;
  /// Waits until the server closes the connection; skips whatever it still sends.
  bool isClosed() const;

  /// Sends the client's header.
  /// @return whether the server's header comes, without an error.
  bool introduce(const std::string& service, bool persistent) const;
  /// @param fields of a request, as they are sent.
  /// @return whether all of it was sent.
  bool request(const std::string& fields) const;
  /// @return the fields of an answer; no value if none comes, or if the service failed.
  std::optional<std::string> answer() const;
  /// Sends a request without fields.
  /// @return whether the answer of a Trigger comes, with success true.
  bool call() const;

 private:
  int socket_;
};

/// 4 bytes, the lowest first.
std::string lengthBytes(std::uint32_t length);
/// The text, preceded by its length.
std::string headerBytes(const TcprosClient::Header& header);
/// The first bytes that a roscpp client sends.
std::string introduction(const std::string& service, bool persistent);

}  // namespace stepdriver::node_test
