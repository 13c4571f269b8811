// The first process of the test kernel; run.sh boots it. It mounts what programs expect, runs the
// three steps that run.sh left in a folder, and turns the machine off. The folder has these files:
//
// - `before`: a bash script that makes the chips. If it fails, nothing else runs.
// - `command`: the arguments of the command, each ended by a zero byte.
// - `after`: a bash script that runs after the command, whatever its result.
// - `environment`: variables for all three, each ended by a zero byte.
// - `directory`: the working directory for all three.
//
// The result goes to the file `status` in that folder: "exit N", as a shell counts, or "error
// TEXT".
#include <fcntl.h>
#include <linux/random.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

std::string contentsOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) fail(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> wordsOf(const std::string& path) {
  std::vector<std::string> words;
  std::ifstream file(path, std::ios::binary);
  if (!file) fail(path);
  for (std::string word; std::getline(file, word, '\0');) words.push_back(word);
  return words;
}

std::vector<char*> pointersTo(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

void mountAll() {
  struct Mount {
    const char* type;
    const char* where;
    const char* options;
  };
  static constexpr std::array<Mount, 8> kMounts{{
      {"proc", "/proc", nullptr},
      {"sysfs", "/sys", nullptr},
      {"configfs", "/sys/kernel/config", nullptr},
      {"tracefs", "/sys/kernel/tracing", nullptr},
      {"devtmpfs", "/dev", nullptr},
      {"devpts", "/dev/pts", nullptr},
      {"tmpfs", "/dev/shm", "mode=1777"},
      {"tmpfs", "/run", "mode=755"},
  }};
  for (const Mount& mount : kMounts) {
    mkdir(mount.where, 0755);
    if (::mount(mount.type, mount.where, mount.type, 0, mount.options) != 0) fail(mount.where);
  }
  // Bash's process substitution and many scripts use these; normally udev makes them.
  for (const auto& [target, name] :
       {std::pair{"/proc/self/fd", "/dev/fd"}, std::pair{"/proc/self/fd/0", "/dev/stdin"},
        std::pair{"/proc/self/fd/1", "/dev/stdout"}, std::pair{"/proc/self/fd/2", "/dev/stderr"}})
    if (symlink(target, name) != 0) fail(name);
}

// This kernel has no source of randomness, so getrandom() would block for ever. The bytes are
// always the same: nothing here is secret, and all runs are alike.
void feedEntropy() {
  constexpr int kBytes = 256;
  alignas(rand_pool_info) std::array<char, sizeof(rand_pool_info) + kBytes> space{};
  auto* const pool = reinterpret_cast<rand_pool_info*>(space.data());
  pool->entropy_count = 8 * kBytes;
  pool->buf_size = kBytes;
  const int device = open("/dev/random", O_WRONLY | O_CLOEXEC);
  if (device < 0 || ioctl(device, RNDADDENTROPY, pool) != 0) fail("/dev/random");
  close(device);
}

void bringLoopbackUp() {
  const int any = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ifreq request{};
  std::strcpy(request.ifr_name, "lo");
  if (any < 0 || ioctl(any, SIOCGIFFLAGS, &request) != 0) fail("lo");
  request.ifr_flags |= IFF_UP;
  if (ioctl(any, SIOCSIFFLAGS, &request) != 0) fail("lo");
  close(any);
  if (sethostname("localhost", std::strlen("localhost")) != 0) fail("sethostname");
}

/// Copies what is written to its pipe to a terminal that is a pipe on the host. Programs see a
/// pipe, so they write as in any script: no colours, no carriage returns.
class Output {
 public:
  explicit Output(const char* terminal) {
    terminal_ = open(terminal, O_WRONLY | O_NOCTTY | O_CLOEXEC);
    std::array<int, 2> ends{};
    termios settings{};
    if (terminal_ < 0 || tcgetattr(terminal_, &settings) != 0 || pipe2(ends.data(), O_CLOEXEC) != 0)
      fail(terminal);
    cfmakeraw(&settings);
    if (tcsetattr(terminal_, TCSANOW, &settings) != 0) fail(terminal);
    write_end_ = ends[1];
    copier_ = std::thread([this, from = ends[0]] { copy(from); });
  }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  /// Returns when everything has arrived. At that time no other process may have the pipe open.
  ~Output() {
    close(write_end_);
    copier_.join();
    tcdrain(terminal_);
  }

  int writeEnd() const { return write_end_; }

 private:
  void copy(int from) const {
    std::array<char, 65536> block{};
    for (;;) {
      const ssize_t size = read(from, block.data(), block.size());
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) return;
      for (ssize_t done = 0; done < size;) {
        const ssize_t now = write(terminal_, block.data() + done, size - done);
        if (now < 0 && errno != EINTR && errno != EAGAIN) return;
        if (now > 0) done += now;
      }
    }
  }

  int terminal_ = -1;
  int write_end_ = -1;
  std::thread copier_;
};

class Steps {
 public:
  Steps(const std::string& work, int output, int errors)
      : environment_(wordsOf(work + "/environment")),
        directory_(contentsOf(work + "/directory")),
        output_(output),
        errors_(errors) {}

  /// @return the exit status; 128 + the signal's number if a signal ended it; 126 or 127 if the
  ///   program can't be run or doesn't exist.
  int run(std::vector<std::string> words) {
    const std::vector<char*> arguments = pointersTo(words);
    const std::vector<char*> variables = pointersTo(environment_);
    const pid_t child = fork();
    if (child < 0) fail("fork");
    if (child == 0) {
      become(arguments, variables);
      _exit(errno == ENOENT ? 127 : 126);
    }
    // Also collects orphans that end meanwhile.
    for (;;) {
      int status = 0;
      const pid_t ended = waitpid(-1, &status, 0);
      if (ended < 0 && errno != EINTR) fail("waitpid");
      if (ended != child) continue;
      return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    }
  }

 private:
  void become(const std::vector<char*>& arguments, const std::vector<char*>& variables) const {
    setsid();
    const int input = open("/dev/null", O_RDONLY);
    if (dup2(input, 0) < 0 || dup2(output_, 1) < 0 || dup2(errors_, 2) < 0) return;
    if (input > 2) close(input);
    if (chdir(directory_.c_str()) == 0) {
      environ = const_cast<char**>(variables.data());
      execvp(arguments[0], arguments.data());
    }
    const int reason = errno;
    std::perror(arguments[0]);
    errno = reason;
  }

  std::vector<std::string> environment_;
  std::string directory_;
  int output_;
  int errors_;
};

std::string runSteps(const std::string& work) {
  const Output output("/dev/tty1");
  const Output errors("/dev/tty2");
  std::string verdict;
  try {
    Steps steps(work, output.writeEnd(), errors.writeEnd());
    if (steps.run({"/bin/bash", work + "/before"}) != 0) {
      verdict = "error the machine couldn't be set up";
    } else {
      verdict = "exit " + std::to_string(steps.run(wordsOf(work + "/command")));
      if (steps.run({"/bin/bash", work + "/after"}) != 0)
        verdict = "error the trace couldn't be taken";
    }
  } catch (const std::exception& error) {
    verdict = std::string("error ") + error.what();
  }
  // Ends the processes that the command left running; this releases the pipes.
  kill(-1, SIGKILL);
  while (waitpid(-1, nullptr, 0) > 0) {
  }
  return verdict;
}

std::string verdictOf(const std::string& work) {
  try {
    mountAll();
    feedEntropy();
    bringLoopbackUp();
    return runSteps(work);
  } catch (const std::exception& error) {
    return std::string("error ") + error.what();
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || getpid() != 1) {
    std::fprintf(stderr, "This is the first process of the test kernel: see run.sh.\n");
    return 2;
  }
  const std::string work = argv[1];
  const std::string verdict = verdictOf(work);
  std::ofstream(work + "/status.new") << verdict << '\n';
  sync();
  std::rename((work + "/status.new").c_str(), (work + "/status").c_str());
  reboot(RB_POWER_OFF);
  return 1;
}
