#pragma once

#include <string>

#include "support/tcpros_client.h"

namespace stepdriver::bad_days {

/// The header of a client of a service of any type, which calls it again and again.
inline std::string introduction(const std::string& service) {
  return node_test::headerBytes(
      {{"callerid", "/flood"}, {"md5sum", "*"}, {"persistent", "1"}, {"service", service}});
}

}  // namespace stepdriver::bad_days
