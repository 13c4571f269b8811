#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::klipper {

/// A board says something that the protocol doesn't allow, or lacks something that is needed. Its
/// text says what, and what helps.
class BoardError : public Error {
 public:
  using Error::Error;
};

/// How a parameter of a message is written.
enum class ParameterKind { kInteger, kBytes };

/// A message as the firmware describes it: `queue_step oid=%c interval=%u count=%hu add=%hi`.
struct MessageFormat {
  std::string text;
  std::vector<ParameterKind> parameters;
};

/// What a firmware says of itself: its messages by their whole format strings, its constants, its
/// pins and its texts.
class Dictionary {
 public:
  /// @param compressed what `identify` has brought: zlib around JSON. @throw BoardError
  static Dictionary unpacked(const std::vector<std::uint8_t>& compressed);
  /// @param json the same without zlib. @throw BoardError
  static Dictionary parsed(const std::string& json);

  const std::string& version() const { return version_; }
  /// The number of a command of the firmware; empty: it has none with exactly this format.
  std::optional<std::int32_t> command(const std::string& format) const;
  /// A command of the same name with another format; empty: there is none.
  std::string otherFormat(const std::string& format) const;
  /// By their numbers, all that the firmware may say.
  const std::map<std::int32_t, MessageFormat>& responses() const { return responses_; }

  /// A constant that is a whole number, such as CLOCK_FREQ.
  std::optional<std::uint64_t> number(const std::string& constant) const;
  /// A constant as a text, such as MCU; empty: there is none.
  std::string text(const std::string& constant) const;
  /// The number of a pin; empty: the board has no pin of that name.
  std::optional<std::uint32_t> pin(const std::string& name) const;
  /// Some names of pins, for messages.
  std::string pinNames() const;
  /// A text of the firmware by its number, such as the reason of a shutdown.
  std::string staticText(std::uint32_t number) const;

 private:
  std::string version_;
  std::map<std::string, std::int32_t> commands_;
  std::map<std::int32_t, MessageFormat> responses_;
  std::map<std::string, std::string> constants_;
  std::map<std::string, std::uint32_t> pins_;
  std::map<std::uint32_t, std::string> texts_;
};

/// @throw BoardError if a parameter has a kind that the protocol doesn't know.
MessageFormat messageFormat(const std::string& text);

}  // namespace stepdriver::klipper
