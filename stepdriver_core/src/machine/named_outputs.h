#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "activity/context.h"
#include "channel/output_line.h"
#include "output_setting.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/machine/io.h"

namespace stepdriver::machine {

/// An output with a name: whether it is to be on, and the only place that knows whether it is. Its
/// line is requested in its safe state.
class NamedOutput {
 public:
  /// @param number of it in the configuration. @param line its index in the request.
  NamedOutput(const config::OutputConfig& config, std::size_t number, int line);

  const std::string& name() const { return config_.name; }
  const OutputState& state() const { return state_; }
  const config::OutputConfig& config() const { return config_; }

  /// Switches it, as soon as its least times allow.
  ///
  /// @param call is answered when that is done, or with the reason if something else comes first.
  void set(const OutputSetting& setting, const activity::SharedCall& call);
  /// Switches it as it begins. @param call is answered when that is done, and doesn't fail if its
  ///   safe state comes first.
  void begin(const activity::SharedCall& call);
  /// Writes a line that has failed once more. @param call is answered when that is done.
  void retry(const activity::SharedCall& call);
  /// @param call is answered when no write is in progress; it fails if the line has failed.
  void await(const activity::SharedCall& call);

  /// Something may have happened.
  ///
  /// @param why_safe why it must be in its safe state; empty: it needn't.
  /// @return why its line could not be written; empty if nothing went wrong.
  std::string poll(activity::Context& context, const std::string& why_safe);
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  bool isBeingWritten() const { return job_.has_value(); }
  /// By its index in the request.
  int line() const { return line_; }
  /// @param error errno of a write of its line.
  std::string failureText(int error, const axis::LineNames& names) const;

 private:
  struct Job {
    std::uint64_t id = 0;
    OutputSetting setting;
    bool safe = false;
    pulse::Nanoseconds began = 0;
    bool doubtful = false;  // a path has switched it meanwhile: nobody knows which was the last
  };

  std::string tooLongText() const;
  std::string endWrite(activity::Context& context);
  std::string adopt(activity::Context& context);
  std::string failed(int error, activity::Context& context);
  activity::MotionOutputs::Line lineForMotions(const std::string& why_safe) const;
  void write(activity::Context& context, bool safe);
  void refuseCalls(const std::string& why);
  void noteWritten(const pulse::WrittenOutput& written);
  bool mustGoOff(pulse::Nanoseconds now) const;
  pulse::Nanoseconds mayChange() const;

  config::OutputConfig config_;
  std::size_t number_;
  int line_;
  OutputSetting wanted_;
  pulse::WrittenOutput written_;
  OutputState state_;
  bool certain_ = true;                  // whether the line has the level of that state for certain
  bool gave_up_ = false;                 // whether it gave up writing the safe state, until retry()
  bool may_wait_ = false;                // whether it may wait for its least times
  bool is_taken_ = false;                // whether a path switches it
  std::uint64_t changes_seen_ = 0;       // by paths
  std::uint64_t failures_seen_ = 0;      // in writes that paths ordered
  std::optional<Job> job_;               // being written
  pulse::Nanoseconds wrote_from_ = 0;    // when the last write began
  pulse::Nanoseconds wrote_until_ = -1;  // when its end was known
  std::vector<activity::SharedCall> calls_;  // wait until it is as wanted
  std::vector<activity::SharedCall>
      write_calls_;  // wait for the end of the next write, if there is one
};

/// All outputs with a name of a machine.
class NamedOutputs {
 public:
  NamedOutputs() = default;
  /// @param lines of each, by its index in the request.
  NamedOutputs(const std::vector<config::OutputConfig>& outputs, const std::vector<int>& lines);

  /// @throw Refused if there is no such output, naming those that there are.
  std::size_t numberOf(const std::string& name) const;
  const config::OutputConfig& config(std::size_t number) const { return outputs_[number].config(); }
  /// Switches each as it begins. @param call is answered when that is done.
  void begin(const activity::SharedCall& call);
  /// @throw Refused if there is no such output, naming those that there are, if a path has it, or
  ///   if it can't have the value.
  void set(const activity::Context& context, const std::string& name, bool on, double value,
           const activity::SharedCall& call);
  /// The machine is stopped. Outputs that paths have are stopped with these.
  void stop(const activity::Context& context);
  /// See NamedOutput.
  void retry(const activity::SharedCall& call);
  void await(const activity::SharedCall& call);
  std::string poll(activity::Context& context, const std::string& why_safe);
  pulse::Nanoseconds due() const;
  bool areBeingWritten() const;
  /// Empty: it is no line of them. @param failure of the line of an output.
  std::string failureText(const pulse::LineFailure& failure, const axis::LineNames& names) const;
  std::vector<OutputState> states() const;
  std::vector<config::OutputConfig> configs() const;
  bool empty() const { return outputs_.empty(); }

 private:
  std::vector<NamedOutput> outputs_;
};

}  // namespace stepdriver::machine
