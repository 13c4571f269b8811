#pragma once

#include <gtest/gtest.h>
#include <stepdriver/RigReport.h>

#include <csignal>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/node_process.h"
#include "support/wait.h"

namespace stepdriver::node_test {

/// A launch file of the package, started as a user starts it, on the test's own master, which
/// outlives it. Everything is in a namespace with the test's name.
class Roslaunch {
 public:
  Roslaunch(const std::string& file, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     // An install space below the sources has files of the same names.
                     {"roslaunch", "--no-summary",
                      std::string(STEPDRIVER_SOURCES "/launch/") + file, "ns:=" + space()});
    process_ = std::make_unique<NodeProcess>(arguments, "/usr/bin/env");
  }
  ~Roslaunch() {
    end();
    if (testing::Test::HasFailure()) std::fputs(process_->output().c_str(), stderr);
  }
  Roslaunch(const Roslaunch&) = delete;
  Roslaunch& operator=(const Roslaunch&) = delete;

  static std::string space() {
    return std::string("/") + testing::UnitTest::GetInstance()->current_test_info()->name();
  }
  /// Full name of a resource of the node.
  static std::string full(const std::string& relative) {
    return space() + "/stepdriver/" + relative;
  }

  /// @return whether the node reports that it is ready before roslaunch ends.
  bool isReady() {
    const auto says = [this] { return process_->output().find("Ready") != std::string::npos; };
    waitUntil([&] { return says() || process_->waitForExit(std::chrono::seconds(0)); });
    return says();
  }

  /// Ends it as Ctrl-C does.
  /// @return the exit code.
  int end() {
    process_->signal(SIGINT);
    return process_->waitForExit(kBound).value_or(-1);
  }

  NodeProcess& process() { return *process_; }

 private:
  std::unique_ptr<NodeProcess> process_;
};

}  // namespace stepdriver::node_test
