#include "machine/state_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <locale>
#include <sstream>
#include <utility>

#include "driver/tmc_registers.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr const char* kTitle = "stepdriver state 1";
constexpr const char* kClean = "clean";
constexpr const char* kRunning = "running";
constexpr const char* kColumns =
    "# axis kind steps_per_unit position backlash_taken_up valid homed translator_at_home moving "
    "@mscnt...";

// Before each MSCNT, which axes of drivers without registers don't have.
constexpr char kMscntMark = '@';

// Nobody else needs to read or write these files.
constexpr mode_t kMode = 0600;
// Far more than the lines of any machine.
constexpr std::size_t kLargest = std::size_t{1} << 20;

[[noreturn]] void failed(const std::string& what, const std::string& path) {
  throw Error(fmt::format("the state file {} can't be {}: {}", path, what, std::strerror(errno)));
}

std::string textOf(const KeptState& state) {
  std::string text = fmt::format("{}\n{}\n{}\n", kTitle, state.clean ? kClean : kRunning, kColumns);
  for (const auto& [name, axis] : state.axes) {
    text +=
        fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:d} {:d} {:d} {:d}", name,
                    axis.kind == config::Kind::kLinear ? "linear" : "rotary", axis.steps_per_unit,
                    axis.position, axis.slack, axis.valid, axis.homed, axis.at_home, axis.moving);
    for (const int mscnt : axis.mscnt) text += fmt::format(" {}{}", kMscntMark, mscnt);
    text += "\n";
  }
  return text;
}

const char* kindOf(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISLNK(mode)) return "a symbolic link";
  if (S_ISFIFO(mode)) return "a named pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

[[noreturn]] void isNoFile(const std::string& path, mode_t mode) {
  throw Error(
      fmt::format("the state file {} is {}, but must be a regular file", path, kindOf(mode)));
}

// Opening a pipe may block for ever, and a link would make this write somewhere else.
void refuseUnlessFile(const std::string& path) {
  struct stat facts {};
  if (lstat(path.c_str(), &facts) == 0 && !S_ISREG(facts.st_mode)) isNoFile(path, facts.st_mode);
}

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  bool isOpen() const { return number_ >= 0; }
  int number() const { return number_; }

 private:
  int number_;
};

/// @return empty if there is no file.
std::optional<std::string> contentsOf(const std::string& path) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!file.isOpen() && errno == ENOENT) return std::nullopt;
  struct stat facts {};
  if (!file.isOpen() || fstat(file.number(), &facts) != 0) failed("read", path);
  if (!S_ISREG(facts.st_mode)) isNoFile(path, facts.st_mode);
  std::string text;
  char part[4096];
  for (;;) {
    const ssize_t count = read(file.number(), part, sizeof part);
    if (count == 0) return text;
    if (count < 0 && errno != EINTR) failed("read", path);
    if (count > 0) text.append(part, static_cast<std::size_t>(count));
    if (text.size() > kLargest) {
      throw Error(fmt::format("the state file {} is larger than {} bytes: it is no state file",
                              path, kLargest));
    }
  }
}

// The new file, written to the disk before it replaces the old one. If that fails, it is removed.
class NewFile {
 public:
  explicit NewFile(const std::string& path) : path_(path), file_(create(path)) {
    if (!file_.isOpen()) failed("written", path_);
  }
  ~NewFile() {
    if (!replaced_) unlink(path_.c_str());
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void write(const std::string& text) const {
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t count = ::write(file_.number(), text.data() + done, text.size() - done);
      if (count < 0 && errno != EINTR) failed("written", path_);
      if (count > 0) done += static_cast<std::size_t>(count);
    }
    if (fsync(file_.number()) != 0) failed("written", path_);
  }

  void replace(const std::string& path) {
    if (std::rename(path_.c_str(), path.c_str()) != 0) failed("replaced", path);
    replaced_ = true;
  }

 private:
  static int create(const std::string& path) {
    // A crash may have left one.
    if (unlink(path.c_str()) != 0 && errno != ENOENT) return -1;
    return open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kMode);
  }

  const std::string& path_;
  const Descriptor file_;
  bool replaced_ = false;
};

void syncDirectory(const std::string& path) {
  const std::string directory = path.substr(0, path.rfind('/') + 1);
  const Descriptor folder(open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.isOpen()) failed("written", path);
  // Some file systems don't support this.
  if (fsync(folder.number()) != 0 && errno != EINVAL) failed("written", path);
}

axis::AxisMemory axisOf(std::istringstream& line, std::string& name) {
  axis::AxisMemory axis;
  std::string kind;
  line.imbue(std::locale::classic());
  line >> name >> kind >> axis.steps_per_unit >> axis.position >> axis.slack >> axis.valid >>
      axis.homed >> axis.at_home;
  axis.kind = kind == "rotary" ? config::Kind::kRotary : config::Kind::kLinear;
  bool whole = !line.fail();
  // Files of earlier versions end here.
  if (!(line >> std::ws).eof()) whole = whole && static_cast<bool>(line >> axis.moving);
  while (whole && !(line >> std::ws).eof()) {
    char mark = 0;
    int mscnt = 0;
    whole = line >> mark >> mscnt && mark == kMscntMark && mscnt >= axis::kUnknownMscnt &&
            mscnt < driver::tmc::kMscntPerCycle;
    axis.mscnt.push_back(mscnt);
  }
  whole = whole && (kind == "linear" || kind == "rotary");
  const bool finite = std::isfinite(axis.position) && std::isfinite(axis.slack);
  if (!whole || !finite || !(axis.steps_per_unit > 0.0)) name.clear();
  return axis;
}

}  // namespace

StateFile::StateFile(std::string path) : path_(std::move(path)) {
  const std::string lock = path_ + ".lock";
  refuseUnlessFile(path_);
  refuseUnlessFile(lock);
  lock_ = open(lock.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, kMode);
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
  const std::optional<std::string> text = contentsOf(path_);
  if (!text) return std::nullopt;
  std::istringstream file(*text);
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
  NewFile file(next);
  file.write(textOf(state));
  file.replace(path_);
  syncDirectory(path_);
}

}  // namespace stepdriver::machine
