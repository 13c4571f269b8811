#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

namespace stepdriver::node_test {

/// Where a service is, as the master knows it. The test fails if it knows none.
std::string serviceUri(const std::string& service);

/// A client of services that sends whatever it likes. Each of its waits is bounded.
class TcprosClient {
 public:
  using Header = std::map<std::string, std::string>;

  /// Connects to where the service is.
  ///
  /// @param receive_buffer of the socket, in bytes; 0: as the system likes.
  explicit TcprosClient(const std::string& service, int receive_buffer = 0);
  ~TcprosClient();
  TcprosClient(const TcprosClient&) = delete;
  TcprosClient& operator=(const TcprosClient&) = delete;

  /// @return whether all of it went out.
  bool send(const std::string& bytes) const;
  /// Sends as much as goes out without waiting. @return how many bytes that is.
  std::size_t sendAtOnce(const std::string& bytes) const;
  /// @return so many bytes; fewer if the connection is closed or nothing more comes.
  std::string receive(std::size_t bytes) const;
  /// @return the fields of a header; none if none comes.
  Header receiveHeader() const;
  /// Waits for the server to close the connection; what it still sends is skipped.
  bool isClosed() const;

  /// Introduces itself. @return whether the server did so too, without an error.
  bool introduce(const std::string& service, bool persistent) const;
  /// Sends a request without fields. @return whether a Trigger's answer comes, that says true.
  bool call() const;

 private:
  int socket_;
};

/// 4 bytes, the lowest first.
std::string lengthBytes(std::uint32_t length);
/// With the length of the whole.
std::string headerBytes(const TcprosClient::Header& header);
/// What a roscpp client sends first.
std::string introduction(const std::string& service, bool persistent);

}  // namespace stepdriver::node_test
