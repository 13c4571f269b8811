#include "port/klipper/messages.h"

#include <fmt/format.h>

#include "port/klipper/vlq.h"

namespace stepdriver::klipper {
namespace {

constexpr std::uint32_t kIdentifyResponse = 0;
constexpr std::uint32_t kIdentify = 1;

constexpr const char* kCommandFormats[kCommands] = {
    "get_config",
    "allocate_oids count=%c",
    "finalize_config crc=%u",
    "get_clock",
    "get_uptime",
    "emergency_stop",
    "config_stepper oid=%c step_pin=%c dir_pin=%c invert_step=%c step_pulse_ticks=%u",
    "queue_step oid=%c interval=%u count=%hu add=%hi",
    "set_next_step_dir oid=%c dir=%c",
    "reset_step_clock oid=%c clock=%u",
    "stepper_get_position oid=%c",
    "stepper_stop_on_trigger oid=%c trsync_oid=%c",
    "config_trsync oid=%c",
    "trsync_start oid=%c report_clock=%u report_ticks=%u expire_reason=%c",
    "trsync_trigger oid=%c reason=%c",
    "config_endstop oid=%c pin=%c pull_up=%c",
    ("endstop_home oid=%c clock=%u sample_ticks=%u sample_count=%c rest_ticks=%u pin_value=%c "
     "trsync_oid=%c trigger_reason=%c"),
    "endstop_query_state oid=%c",
    "config_digital_out oid=%c pin=%u value=%c default_value=%c max_duration=%u",
    "update_digital_out oid=%c value=%c",
};

constexpr const char* kAnswerFormats[kAnswers] = {
    "config is_config=%c crc=%u is_shutdown=%c move_count=%hu",
    "clock clock=%u",
    "uptime high=%u clock=%u",
    "stepper_position oid=%c pos=%i",
    "trsync_state oid=%c can_trigger=%c trigger_reason=%c clock=%u",
    "endstop_state oid=%c homing=%c next_clock=%u pin_value=%c",
    "shutdown clock=%u static_string_id=%hu",
    "is_shutdown static_string_id=%hu",
    "starting",
};

[[noreturn]] void lacks(const Dictionary& dictionary, const std::string& board, const char* format,
                        const std::string& other) {
  const std::string instead = other.empty() ? "" : fmt::format(", but \"{}\"", other);
  throw BoardError(fmt::format(
      "the firmware of the board {} lacks \"{}\"{} (version {}): flash a version of "
      "Klipper's firmware that has it, or disable what takes it away in its menuconfig",
      board, format, instead, dictionary.version().empty() ? "unknown" : dictionary.version()));
}

bool skip(const MessageFormat& format, const std::uint8_t*& begin, const std::uint8_t* end,
          std::uint32_t* arguments, std::size_t room) {
  std::size_t taken = 0;
  for (const ParameterKind kind : format.parameters) {
    if (kind == ParameterKind::kInteger) {
      const auto value = takeVlq(begin, end);
      if (!value) return false;
      if (taken < room) arguments[taken++] = *value;
      continue;
    }
    if (begin == end) return false;
    const std::size_t size = *begin++;
    if (static_cast<std::size_t>(end - begin) < size) return false;
    begin += size;
  }
  return true;
}

}  // namespace

const char* formatOf(Command command) { return kCommandFormats[static_cast<std::size_t>(command)]; }
const char* formatOf(Answer answer) { return kAnswerFormats[static_cast<std::size_t>(answer)]; }

Messages::Messages(const Dictionary& dictionary, const std::string& board) {
  for (std::size_t i = 0; i < kCommands; ++i) {
    const auto id = dictionary.command(kCommandFormats[i]);
    if (!id)
      lacks(dictionary, board, kCommandFormats[i], dictionary.otherFormat(kCommandFormats[i]));
    ids_.at(i) = *id;
  }
  std::array<bool, kAnswers> found{};
  for (const auto& [id, format] : dictionary.responses()) {
    Known known{format, {}};
    for (std::size_t i = 0; i < kAnswers; ++i) {
      if (format.text != kAnswerFormats[i]) continue;
      known.answer = static_cast<Answer>(i);
      found.at(i) = true;
    }
    answers_.emplace(id, known);
  }
  for (std::size_t i = 0; i < kAnswers; ++i) {
    if (!found.at(i)) lacks(dictionary, board, kAnswerFormats[i], "");
  }
}

Message Messages::encode(Command command, std::initializer_list<std::uint32_t> arguments) const {
  Message message;
  std::uint8_t* end = putVlq(
      message.bytes.data(), static_cast<std::uint32_t>(ids_.at(static_cast<std::size_t>(command))));
  for (const std::uint32_t argument : arguments) end = putVlq(end, argument);
  message.size = static_cast<std::size_t>(end - message.bytes.data());
  return message;
}

std::optional<Heard> Messages::decode(const std::uint8_t*& content, const std::uint8_t* end) const {
  while (content != end) {
    Heard heard;
    const auto id = takeVlq(content, end);
    const auto known = id ? answers_.find(static_cast<std::int32_t>(*id)) : answers_.end();
    if (known == answers_.end() ||
        !skip(known->second.format, content, end, heard.arguments.data(), heard.arguments.size())) {
      content = end;  // nobody knows where the next message begins
      return std::nullopt;
    }
    if (!known->second.answer) continue;
    heard.answer = *known->second.answer;
    return heard;
  }
  return std::nullopt;
}

Message identify(std::uint32_t offset) {
  Message message;
  std::uint8_t* end = putVlq(message.bytes.data(), kIdentify);
  end = putVlq(putVlq(end, offset), kPiece);
  message.size = static_cast<std::size_t>(end - message.bytes.data());
  return message;
}

std::optional<Piece> identified(const std::uint8_t* content, const std::uint8_t* end) {
  const auto id = takeVlq(content, end);
  if (!id || *id != kIdentifyResponse) return std::nullopt;
  const auto offset = takeVlq(content, end);
  if (!offset || content == end) return std::nullopt;
  const std::size_t size = *content++;
  if (static_cast<std::size_t>(end - content) < size) return std::nullopt;
  return Piece{*offset, content, size};
}

}  // namespace stepdriver::klipper
