#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <string>

#include "DiagnosticStatusWrapper.h"

namespace diagnostic_updater {

/// In place of the package diagnostic_updater, on systems that lack it: there is no /diagnostics.
class Updater {
 public:
  explicit Updater(const ros::NodeHandle& /*node*/ = {},
                   const ros::NodeHandle& /*private_node*/ = {}) {}
  void setHardwareID(const std::string& /*hardware_id*/) {}
  void add(const std::string& /*name*/,
           const std::function<void(DiagnosticStatusWrapper&)>& /*tell*/) {}
  void force_update() {}
};

}  // namespace diagnostic_updater
