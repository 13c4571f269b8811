#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>

#include "port/klipper/dictionary.h"
#include "port/klipper/frame.h"

namespace stepdriver::klipper {

/// The commands that are sent to a board.
enum class Command : std::uint8_t {
  kGetConfig,
  kAllocateOids,
  kFinalizeConfig,
  kGetClock,
  kGetUptime,
  kEmergencyStop,
  kConfigStepper,
  kQueueStep,
  kSetNextStepDir,
  kResetStepClock,
  kStepperGetPosition,
  kStepperStopOnTrigger,
  kConfigTrsync,
  kTrsyncStart,
  kTrsyncTrigger,
  kConfigEndstop,
  kEndstopHome,
  kEndstopQueryState,
  kConfigDigitalOut,
  kUpdateDigitalOut,
};
constexpr std::size_t kCommands = 20;

/// The whole format of a command, by which a firmware has it or not.
const char* formatOf(Command command);

/// What a board says.
enum class Answer : std::uint8_t {
  kConfig,
  kClock,
  kUptime,
  kStepperPosition,
  kTrsyncState,
  kEndstopState,
  kShutdown,    ///< it has just shut down
  kIsShutdown,  ///< it refuses commands because it has
  kStarting,    ///< it was reset
};
constexpr std::size_t kAnswers = 9;
const char* formatOf(Answer answer);

/// A command with its arguments.
struct Message {
  std::array<std::uint8_t, kMostContent> bytes{};
  std::size_t size = 0;
};

/// An answer with its arguments.
struct Heard {
  Answer answer = Answer::kStarting;
  std::array<std::uint32_t, 5> arguments{};
};

/// The messages of one firmware, by its dictionary. `identify` is the one command that every
/// firmware has with the same number: it brings the dictionary.
class Messages {
 public:
  /// @throw BoardError naming the first command or answer that the firmware lacks, and its version.
  Messages(const Dictionary& dictionary, const std::string& board);

  Message encode(Command command, std::initializer_list<std::uint32_t> arguments = {}) const;

  /// Takes the next known answer from the content of a frame, and moves its beginning behind it.
  /// @return empty: there is no further one.
  std::optional<Heard> decode(const std::uint8_t*& content, const std::uint8_t* end) const;

 private:
  struct Known {
    MessageFormat format;
    std::optional<Answer> answer;
  };
  std::array<std::int32_t, kCommands> ids_{};
  std::map<std::int32_t, Known> answers_;
};

/// @name `identify`, which brings the dictionary piece by piece
/// @{
constexpr std::uint32_t kPiece = 40;  ///< [bytes]
Message identify(std::uint32_t offset);
struct Piece {
  std::uint32_t offset = 0;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};
std::optional<Piece> identified(const std::uint8_t* content, const std::uint8_t* end);
/// @}

}  // namespace stepdriver::klipper
