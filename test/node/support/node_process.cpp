#include "support/node_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

constexpr int kCannotExecute = 127;

const char* fromEnvironment(const char* name, const char* otherwise) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : otherwise;
}

}  // namespace

const char* const kStepdriverNode = fromEnvironment("STEPDRIVER_NODE", STEPDRIVER_NODE);
const char* const kStepdriverJoystick = STEPDRIVER_JOYSTICK;
const char* const kStepdriverBase = STEPDRIVER_BASE;

NodeProcess::NodeProcess(const std::vector<std::string>& arguments, const std::string& program) {
  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("no process");
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // A test that crashes leaves no node behind.
    dup2(ends[1], STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(kCannotExecute);
  }
  close(ends[1]);
  reader_ = std::thread([this, stream = ends[0]] { readOutput(stream); });
}

NodeProcess::~NodeProcess() {
  if (!exit_code_) {
    kill(pid_, SIGKILL);
    waitForExit(kBound);
  }
  if (reader_.joinable()) reader_.join();
}

void NodeProcess::signal(int number) const {
  if (!exit_code_) kill(pid_, number);
}

std::size_t NodeProcess::kilobytes(const std::string& field) const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  for (std::string name; status >> name; std::getline(status, name)) {
    std::size_t value = 0;
    if (name == field + ":" && status >> value) return value;
  }
  throw std::runtime_error("no " + field + " in the process's status");
}

std::size_t NodeProcess::descriptors() const {
  const std::filesystem::directory_iterator open("/proc/" + std::to_string(pid_) + "/fd");
  return static_cast<std::size_t>(std::distance(begin(open), end(open)));
}

std::optional<int> NodeProcess::waitForExit(std::chrono::duration<double> bound) {
  if (exit_code_) return exit_code_;
  int status = 0;
  if (!waitUntil([&] { return waitpid(pid_, &status, WNOHANG) == pid_; }, bound)) return {};
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  reader_.join();
  return exit_code_;
}

std::string NodeProcess::output() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return output_;
}

void NodeProcess::readOutput(int stream) {
  std::array<char, 4096> buffer{};
  for (;;) {
    const ssize_t size = read(stream, buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    const std::lock_guard<std::mutex> lock(mutex_);
    output_.append(buffer.data(), static_cast<std::size_t>(size));
  }
  close(stream);
}

}  // namespace stepdriver::node_test
