#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace stepdriver::test {

/// A new folder, which is removed at the end with all that is in it.
class TemporaryFolder {
 public:
  /// @throw std::system_error if it can't be made in `parent`.
  explicit TemporaryFolder(const std::string& parent = "/tmp")
      : path_(parent + "/stepdriver_test_XXXXXX") {
    if (mkdtemp(path_.data()) == nullptr) {
      throw std::system_error(errno, std::generic_category(), path_);
    }
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace stepdriver::test
