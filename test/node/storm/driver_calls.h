#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_client.h>

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "storm/request_log.h"

namespace stepdriver::storm {

/// The topics of the driver that clients publish to, shared by all clients. Thread-safe.
class DriverTopics {
 public:
  DriverTopics(const std::string& node, RequestLog& log);

  /// A message of a jog. It counts as a request only if it may begin a jog: after a pause or a 0.
  void jog(int client, std::size_t axis, double velocity);
  /// Messages of setpoints, for one axis or for all. They count as a request of those axes for
  /// which they may begin a stream: after a pause.
  void setpoint(int client, std::size_t axis, double position);
  void setpoints(int client, const std::vector<double>& positions);
  void command(int client, const std::vector<std::size_t>& axes,
               const std::vector<double>& positions, double duration);
  /// @param ahead [s] how far ahead its stamp lies; 0: none
  void followTrajectory(int client, const std::vector<std::size_t>& axes,
                        const std::vector<double>& positions, double duration, double ahead);
  void cancelTrajectories();
  void moveByAction(int client, std::size_t axis, double position, bool relative);
  void cancelMove(std::size_t axis);
  /// Positions of the axes, x first, at the edges of the input kInput; in a window, if there is
  /// one.
  void latch(int client, bool every, const std::optional<WindowOrder>& window);
  /// A message of the topic of an output. @param output its number in kOutputs
  void output(int client, std::size_t output, double value);
  void cancelLatches();

  /// Whether the node subscribes to all of them.
  bool connected() const;

 private:
  struct JogMessage {
    std::int64_t at = 0;
    bool moves = false;
  };

  /// Logs the message if it may begin streams.
  void noteSetpoints(int client, const std::vector<std::size_t>& axes,
                     const std::vector<double>& positions);

  RequestLog& log_;
  mutable std::mutex mutex_;
  ros::Publisher jog_;
  ros::Publisher command_;
  ros::Publisher trajectory_goal_;
  ros::Publisher trajectory_cancel_;
  std::vector<ros::Publisher> move_goals_;
  std::vector<ros::Publisher> move_cancels_;
  ros::Publisher latch_goal_;
  ros::Publisher latch_cancel_;
  std::vector<ros::Publisher> outputs_;
  ros::Publisher setpoints_;
  std::vector<ros::Publisher> setpoint_;
  std::map<std::size_t, JogMessage> jogs_;              // the last message of each axis
  std::map<std::size_t, std::int64_t> setpoints_sent_;  // when the last one of each axis was sent
};

/// The driver's services, called by one client thread over connections that stay open. Each call is
/// logged.
class DriverCalls {
 public:
  DriverCalls(std::string node, int client, RequestLog& log)
      : node_(std::move(node)), client_(client), log_(log) {}

  bool moveTo(std::size_t axis, double position, bool relative, bool wait);
  bool moveRounds(std::size_t axis, double rounds, bool wait);
  bool moveLine(const std::vector<std::size_t>& axes, const std::vector<double>& positions,
                bool relative, double duration, bool wait);
  /// Where a path switches the output kPathOutput.
  enum class Marks {
    kNone,
    kAtCorners,  ///< on for its second line
    /// On from the middle of its first line to that of the second one, and in the last one, with
    /// lead times: the oracle knows the places.
    kOnTheWay,
  };
  /// A zigzag of three lines around the positions of the axes.
  ///
  /// @param velocity [m/s] 0: the highest
  /// @return its number; 0: refused
  std::uint64_t followPath(const std::vector<std::size_t>& axes, double size, bool more_follows,
                           double velocity = 0.0, Marks marks = Marks::kNone);
  bool appendPath(std::uint64_t path, const std::vector<std::size_t>& axes, double size,
                  bool more_follows, Marks marks);
  /// Until the input kInput tells of a contact, or its end.
  bool probe(std::size_t axis, double position, bool away, bool twice, bool returns);
  /// @param output its number in kOutputs
  bool setOutput(std::size_t output, bool on);
  bool setOutputValue(std::size_t output, double value);
  bool home(std::size_t axis, bool wait);
  bool homeAll(bool wait);
  bool microstep(std::size_t axis, int microsteps);
  bool setLimits(std::size_t axis, double max_speed, double acceleration, double jerk);
  bool setPosition(std::size_t axis, double position);
  /// [A rms]
  bool setCurrent(std::size_t axis, double run, double hold);
  /// The position of an axis switches the output kComparedOutput: it is on between two places,
  /// and is switched earlier by a lead [s].
  bool compareCam(std::size_t axis, double from, double to, double lead);
  /// The same with pulses.
  bool comparePulses(const CompareOrder& order);
  /// The position of no axis does.
  bool clearCompare();
  bool speedOverride(double factor);
  /// Calls of std_srvs/SetBool for an axis: enable, sleep; press_min and press_max of the rig.
  bool set(Kind kind, std::size_t axis, const std::string& service, bool data);
  /// Calls of std_srvs/Trigger.
  bool trigger(Kind kind, AxisSet axes, const std::string& service);

 private:
  /// @param answer reads from an answer the positions of axes that had a target, and a contact.
  template <typename Service, typename Reader>
  bool call(Request request, const std::string& service, Service& call, const Reader& answer);
  template <typename Service>
  bool call(Request request, const std::string& service, Service& call);

  std::string node_;
  int client_;
  RequestLog& log_;
  std::map<std::string, ros::ServiceClient> clients_;
};

extern const std::vector<std::string> kAxisNames;
constexpr AxisSet kAllAxes = 7;
constexpr const char* kComparedOutput = "tool";
constexpr const char* kPathOutput = "pen";
/// Only requests switch it; it has least times and a longest one.
constexpr const char* kTimedOutput = "pump";
constexpr double kMaxOn = 0.8;    // [s]
constexpr double kMinOn = 0.03;   // [s]
constexpr double kMinOff = 0.04;  // [s]
/// A PWM output.
constexpr const char* kPwmOutput = "laser";
const std::vector<std::string> kOutputs{kComparedOutput, kPathOutput, kTimedOutput, kPwmOutput};
constexpr std::size_t kPathOutputIndex = 1;
constexpr std::size_t kPwmOutputIndex = 3;
/// The carriage of x presses it.
constexpr const char* kInput = "probe";

}  // namespace stepdriver::storm
