#pragma once

#include <gtest/gtest.h>
#include <ros/param.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/RigReport.h>

#include <cstdint>
#include <memory>
#include <string>

#include "support/call_service.h"
#include "support/constants.h"
#include "support/node_process.h"
#include "support/temporary_file.h"

namespace stepdriver::node_test {

using test::kInfinity;
using test::kNan;
using test::kPi;

/// Distances of the axis x below.
inline constexpr double kStep = 1.0 / 80'000.0;  // m, a microstep
inline constexpr double kHalfStep = kStep / 2.0;

/// A stepdriver_node for one test, in a namespace with the test's name, on the simulated rig.
///
/// Its parameters are initially those of one linear axis x: an A4988 at 1/16 with every pin wired,
/// 80 steps/mm, 3200 steps per revolution, at most 100 mm/s and 500 mm/s^2, soft limits at 0 and
/// 200 mm, both endstops, enabled on start. The rig runs 20 times as fast as the wall clock.
class NodeUnderTest {
 public:
  NodeUnderTest();
  ~NodeUnderTest();
  NodeUnderTest(const NodeUnderTest&) = delete;
  NodeUnderTest& operator=(const NodeUnderTest&) = delete;

  /// Full name of the node.
  const std::string& name() const { return name_; }
  std::string full(const std::string& relative) const { return name_ + "/" + relative; }
  /// Full name of a resource in the node's namespace.
  std::string beside(const std::string& relative) const { return space_ + "/" + relative; }

  // Call before the start.
  template <typename Value>
  void set(const std::string& key, const Value& value) {
    ros::param::set(full(key), value);
  }
  void erase(const std::string& key);
  void describe(const std::string& urdf) { ros::param::set(beside("robot_description"), urdf); }
  /// Makes the rig write its trace.
  /// @return the file, which exists as long as this object.
  std::string traced();

  /// Starts the node, and doesn't wait for it.
  NodeProcess& launch();
  /// Starts the node, and waits until it is ready.
  NodeProcess& start();
  NodeProcess& process() { return *process_; }

  /// Calls a service below the node's name; the test fails if no answer comes.
  template <typename Service>
  typename Service::Response call(const std::string& service,
                                  const typename Service::Request& request = {}) {
    Service call;
    call.request = request;
    EXPECT_TRUE(callService(full(service), call)) << service << " doesn't answer";
    return call.response;
  }

  MoveTo::Response moveTo(double position, bool wait, double velocity = 0.0);

  /// The rig's report, with one axis.
  RigReport::Response rig() { return call<RigReport>("rig/report"); }
  std::int64_t pulses();

 private:
  std::string space_;
  std::string name_;
  std::unique_ptr<TemporaryFile> trace_;  // the node writes it until it ends
  std::unique_ptr<NodeProcess> process_;
};

}  // namespace stepdriver::node_test
