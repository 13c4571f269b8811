#pragma once

#include <string>

#include "../driver_client.h"
#include "../session.h"
#include "machine_at_hand.h"

namespace stepdriver::console {

/// The running driver. For one thread, which serves the global callback queue through it.
class DriverAtHand : public MachineAtHand {
 public:
  DriverAtHand(const ros::NodeHandle& node, const std::string& driver,
               const DriverParameters& parameters)
      : session_(driver, {}), client_(node, session_, parameters) {}

  void wait() override;
  int states() const override { return session_.driver().updates(); }
  AxisView state(const std::string& axis) override;
  client::Answer enable(const std::string& axis, bool on) override;
  client::Answer setPosition(const std::string& axis, double position) override;
  client::Answer move(const std::string& axis, double distance, double speed) override;
  client::Answer stop(const std::string& axis) override;

  /// Handles the driver's messages. @throw Error if the driver has stopped sending them.
  void poll();
  /// Waits for the first state of the axes and of their switches. @throw Error if there is none.
  void awaitState();

 private:
  bool complete() const;
  double unitsOf(const std::string& axis) const;
  std::string service(const std::string& axis, const std::string& name) const;

  Session session_;
  DriverClient client_;
};

}  // namespace stepdriver::console
