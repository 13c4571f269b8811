#include "machine/state_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <locale>
#include <sstream>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr const char* kTitle = "stepdriver state 1";
constexpr const char* kClean = "clean";
constexpr const char* kRunning = "running";
constexpr const char* kColumns =
    "# axis kind steps_per_unit position backlash_taken_up valid homed translator_at_home moving";

[[noreturn]] void failed(const std::string& what, const std::string& path) {
  throw Error(fmt::format("the state file {} can't be {}: {}", path, what, std::strerror(errno)));
}

std::string textOf(const KeptState& state) {
  std::string text = fmt::format("{}\n{}\n{}\n", kTitle, state.clean ? kClean : kRunning, kColumns);
  for (const auto& [name, axis] : state.axes) {
    text +=
        fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:d} {:d} {:d} {:d}\n", name,
                    axis.kind == config::Kind::kLinear ? "linear" : "rotary", axis.steps_per_unit,
                    axis.position, axis.slack, axis.valid, axis.homed, axis.at_home, axis.moving);
  }
  return text;
}

// The new file, written to the disk before it replaces the old one.
class NewFile {
 public:
  explicit NewFile(const std::string& path)
      : path_(path), file_(open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)) {
    if (file_ < 0) failed("written", path_);
  }
  ~NewFile() { close(file_); }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void write(const std::string& text) const {
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t count = ::write(file_, text.data() + done, text.size() - done);
      if (count < 0 && errno != EINTR) failed("written", path_);
      if (count > 0) done += static_cast<std::size_t>(count);
    }
    if (fsync(file_) != 0) failed("written", path_);
  }

 private:
  const std::string& path_;
  int file_;
};

void syncDirectory(const std::string& path) {
  const std::string directory = path.substr(0, path.rfind('/') + 1);
  const int file = open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) failed("written", path);
  const int result = fsync(file);
  close(file);
  // Some file systems don't support this.
  if (result != 0 && errno != EINVAL) failed("written", path);
}

axis::AxisMemory axisOf(std::istringstream& line, std::string& name) {
  axis::AxisMemory axis;
  std::string kind;
  std::string rest;
  line.imbue(std::locale::classic());
  line >> name >> kind >> axis.steps_per_unit >> axis.position >> axis.slack >> axis.valid >>
      axis.homed >> axis.at_home;
  axis.kind = kind == "rotary" ? config::Kind::kRotary : config::Kind::kLinear;
  bool whole = !line.fail();
  // Files of earlier versions end here.
  if (!(line >> std::ws).eof()) whole = whole && static_cast<bool>(line >> axis.moving);
  whole = whole && !(line >> rest) && (kind == "linear" || kind == "rotary");
  const bool finite = std::isfinite(axis.position) && std::isfinite(axis.slack);
  if (!whole || !finite || !(axis.steps_per_unit > 0.0)) name.clear();
  return axis;
}

}  // namespace

StateFile::StateFile(std::string path) : path_(std::move(path)) {
  const std::string lock = path_ + ".lock";
  lock_ = open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_ < 0) failed("written", path_);
  if (flock(lock_, LOCK_EX | LOCK_NB) == 0) return;
  const int error = errno;
  close(lock_);
  errno = error;
  if (error == EWOULDBLOCK) {
    throw Error(fmt::format("the state file {} is used by another program: each node needs its own",
                            path_));
  }
  failed("locked", path_);
}

StateFile::~StateFile() { close(lock_); }

std::optional<KeptState> StateFile::load() const {
  std::ifstream file(path_);
  if (!file) {
    if (errno == ENOENT) return std::nullopt;
    failed("read", path_);
  }
  const auto broken = [this](int line) {
    return Error(
        fmt::format("the state file {} is broken in line {}; delete or correct it", path_, line));
  };
  KeptState state;
  std::string line;
  if (!std::getline(file, line) || line != kTitle) throw broken(1);
  if (!std::getline(file, line) || (line != kClean && line != kRunning)) throw broken(2);
  state.clean = line == kClean;
  for (int number = 3; std::getline(file, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string name;
    const axis::AxisMemory axis = axisOf(words, name);
    if (name.empty() || !state.axes.emplace(name, axis).second) throw broken(number);
  }
  return state;
}

void StateFile::save(const KeptState& state) const {
  const std::string next = path_ + ".new";
  {
    const NewFile file(next);
    file.write(textOf(state));
  }
  if (std::rename(next.c_str(), path_.c_str()) != 0) failed("replaced", path_);
  syncDirectory(path_);
}

}  // namespace stepdriver::machine
