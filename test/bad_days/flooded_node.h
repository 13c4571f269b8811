#pragma once

#include <gtest/gtest.h>
#include <sensor_msgs/JointState.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "emergency_probe.h"
#include "support/node_under_test.h"
#include "support/recorder.h"

namespace stepdriver::bad_days {

/// A node with one axis. Each test begins a flood, calls endure(), and ends the flood. Afterwards
/// the node must serve as before. It has the limits of the unit of systemd.
class FloodedNode : public testing::Test {
 protected:
  FloodedNode();
  void SetUp() override;
  void TearDown() override;

  /// Measures the emergency stop for `~seconds`, then begins moves and stops them with it.
  ///
  /// @param flood tells afterwards what the flood has done, for the printed figures.
  void endure(const std::function<std::string()>& flood);
  /// Begins a move that would take minutes, and waits for its first pulses.
  void beginMove();
  /// Ends the move by calls of emergency_stop, and expects no pulse after their answers.
  void endMove();

  /// The memory and descriptors from which the flood begins. SetUp() calls it.
  void noteBefore();

  std::chrono::duration<double> seconds() const { return seconds_; }

  node_test::NodeUnderTest node_;

 private:
  /// @return whether the axis may move again.
  bool recover();
  void expectAlive();
  void expectDescriptorsBack();
  void expectLittleMemory();
  /// [kB] of the node's own memory, since the beginning of the flood.
  std::size_t growth();
  void expectNothingMoves();
  void expectCountsEqual();
  void print();

  const std::chrono::duration<double> seconds_;
  std::unique_ptr<node_test::Recorder<sensor_msgs::JointState>> states_;
  std::unique_ptr<EmergencyProbe> probe_;
  std::string flood_;
  std::size_t descriptors_before_ = 0;
  std::size_t memory_before_ = 0;      // [kB] all of it
  std::size_t own_memory_before_ = 0;  // [kB] without files
  std::size_t most_memory_ = 0;        // [kB] all of it
};

}  // namespace stepdriver::bad_days
