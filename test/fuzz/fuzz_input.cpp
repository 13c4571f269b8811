#include "fuzz/fuzz_input.h"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <ios>

#include "printable.h"
#include "support/temporary_folder.h"

namespace stepdriver::fuzz {

void require(bool kept, const std::string& promise) {
  if (kept) return;
  std::fprintf(stderr, "\nbroken promise: %s\n", promise.c_str());
  std::abort();
}

void requireMessage(const std::string& message) {
  constexpr std::size_t kLongest = 20'000;
  require(!message.empty(), "a refusal has a message");
  require(isPrintable(message), "a message has no control characters: " + printable(message));
  require(message.size() <= kLongest, "a message is at most " + std::to_string(kLongest) +
                                          " characters long: " + message.substr(0, 200));
}

const std::string& ownFolder() {
  static const test::TemporaryFolder folder(access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
  return folder.path();
}

void writeFile(const std::string& path, const std::uint8_t* data, std::size_t size) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  file.close();
  require(file.good(), path + " can be written");
}

}  // namespace stepdriver::fuzz
