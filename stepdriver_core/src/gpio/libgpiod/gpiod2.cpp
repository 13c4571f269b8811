#include <gpiod.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "gpiod_calls.h"

// libgpiod 2. It aborts if it is given a null object, so every new object is checked first.

namespace stepdriver::gpio::gpiod {
namespace {

constexpr std::size_t kEdgesAtOnce = 16;

/// Frees an object of libgpiod with its function.
template <auto function>
struct Free {
  template <typename Object>
  void operator()(Object* object) const {
    function(object);
  }
};
using ChipHandle = std::unique_ptr<gpiod_chip, Free<gpiod_chip_close>>;
using ChipInfoHandle = std::unique_ptr<gpiod_chip_info, Free<gpiod_chip_info_free>>;
using LineInfoHandle = std::unique_ptr<gpiod_line_info, Free<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Free<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Free<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Free<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Free<gpiod_line_request_release>>;
using EdgeBuffer = std::unique_ptr<gpiod_edge_event_buffer, Free<gpiod_edge_event_buffer_free>>;

[[noreturn]] void fail(const char* call) {
  throw std::system_error(errno, std::generic_category(), call);
}

/// An object that libgpiod made.
template <typename Handle, typename Object>
Handle made(Object* object, const char* call) {
  if (object == nullptr) fail(call);
  return Handle(object);
}

void check(int result, const char* call) {
  if (result < 0) fail(call);
}

gpiod_line_value valueOf(bool level) {
  return level ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
}

gpiod_line_bias biasOf(Bias bias) {
  switch (bias) {
    case Bias::kPullUp:
      return GPIOD_LINE_BIAS_PULL_UP;
    case Bias::kPullDown:
      return GPIOD_LINE_BIAS_PULL_DOWN;
    case Bias::kDisabled:
      return GPIOD_LINE_BIAS_DISABLED;
    case Bias::kAsIs:
      break;
  }
  return GPIOD_LINE_BIAS_AS_IS;
}

/// A request under construction.
class Wanted {
 public:
  explicit Wanted(gpiod_line_direction direction)
      : settings_(made<Settings>(gpiod_line_settings_new(), "gpiod_line_settings_new")),
        lines_(made<LineConfig>(gpiod_line_config_new(), "gpiod_line_config_new")) {
    check(gpiod_line_settings_set_direction(settings_.get(), direction),
          "gpiod_line_settings_set_direction");
  }

  /// The settings for the lines that are added next.
  gpiod_line_settings* settings() { return settings_.get(); }

  void add(unsigned offset) {
    check(gpiod_line_config_add_line_settings(lines_.get(), &offset, 1, settings_.get()),
          "gpiod_line_config_add_line_settings");
  }

  Request from(gpiod_chip* chip) {
    const auto config = made<RequestConfig>(gpiod_request_config_new(), "gpiod_request_config_new");
    gpiod_request_config_set_consumer(config.get(), kConsumer);
    return made<Request>(gpiod_chip_request_lines(chip, config.get(), lines_.get()),
                         "gpiod_chip_request_lines");
  }

 private:
  Settings settings_;
  LineConfig lines_;
};

class Outputs2 : public Outputs {
 public:
  Outputs2(gpiod_chip* chip, const std::vector<OutputLine>& lines) {
    Wanted wanted(GPIOD_LINE_DIRECTION_OUTPUT);
    for (const OutputLine& line : lines) {
      check(gpiod_line_settings_set_output_value(wanted.settings(), valueOf(line.level)),
            "gpiod_line_settings_set_output_value");
      wanted.add(line.offset);
      offsets_.push_back(line.offset);
    }
    request_ = wanted.from(chip);
  }

  int set(LineBits lines, LineBits levels) noexcept override {
    std::array<unsigned, kMostLines> offsets;
    std::array<gpiod_line_value, kMostLines> values;
    std::size_t count = 0;
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      if ((lines & bitOf(i)) == 0) continue;
      offsets[count] = offsets_[i];
      values[count++] = valueOf((levels & bitOf(i)) != 0);
    }
    const int result =
        gpiod_line_request_set_values_subset(request_.get(), count, offsets.data(), values.data());
    return result < 0 ? errno : 0;
  }

 private:
  std::vector<unsigned> offsets_;
  Request request_;
};

class Inputs2 : public Inputs {
 public:
  Inputs2(gpiod_chip* chip, const std::vector<InputLine>& lines) {
    Wanted wanted(GPIOD_LINE_DIRECTION_INPUT);
    bool edges = false;
    for (const InputLine& line : lines) {
      check(gpiod_line_settings_set_bias(wanted.settings(), biasOf(line.bias)),
            "gpiod_line_settings_set_bias");
      check(gpiod_line_settings_set_edge_detection(
                wanted.settings(), line.edges ? GPIOD_LINE_EDGE_BOTH : GPIOD_LINE_EDGE_NONE),
            "gpiod_line_settings_set_edge_detection");
      wanted.add(line.offset);
      offsets_.push_back(line.offset);
      edges = edges || line.edges;
    }
    buffer_ =
        made<EdgeBuffer>(gpiod_edge_event_buffer_new(kEdgesAtOnce), "gpiod_edge_event_buffer_new");
    request_ = wanted.from(chip);
    if (edges) edge_fds_.push_back(gpiod_line_request_get_fd(request_.get()));
  }

  int get(int line) noexcept override {
    const gpiod_line_value value =
        gpiod_line_request_get_value(request_.get(), offsets_[static_cast<std::size_t>(line)]);
    return value == GPIOD_LINE_VALUE_ERROR ? -errno : static_cast<int>(value);
  }

  const std::vector<int>& edgeFds() const override { return edge_fds_; }

  int takeEdges(std::size_t /*fd*/, EdgeEvent* edges, std::size_t capacity) noexcept override {
    const int count = gpiod_line_request_read_edge_events(
        request_.get(), buffer_.get(), capacity < kEdgesAtOnce ? capacity : kEdgesAtOnce);
    if (count < 0) return -errno;
    for (int i = 0; i < count; ++i) {
      gpiod_edge_event* const event =
          gpiod_edge_event_buffer_get_event(buffer_.get(), static_cast<unsigned long>(i));
      if (event == nullptr) return -errno;
      edges[i] = {lineAt(gpiod_edge_event_get_line_offset(event)),
                  gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE,
                  static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))};
    }
    return count;
  }

 private:
  int lineAt(unsigned offset) const {
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      if (offsets_[i] == offset) return static_cast<int>(i);
    }
    return -1;
  }

  std::vector<unsigned> offsets_;
  std::vector<int> edge_fds_;
  EdgeBuffer buffer_;
  Request request_;
};

std::string textOf(const char* text) { return text == nullptr ? "" : text; }

class Chip2 : public Chip {
 public:
  explicit Chip2(const std::string& path)
      : chip_(made<ChipHandle>(gpiod_chip_open(path.c_str()), "gpiod_chip_open")) {}

  ChipInfo info() override {
    const auto chip = made<ChipInfoHandle>(gpiod_chip_get_info(chip_.get()), "gpiod_chip_get_info");
    ChipInfo info;
    info.name = textOf(gpiod_chip_info_get_name(chip.get()));
    info.label = textOf(gpiod_chip_info_get_label(chip.get()));
    const auto count = static_cast<unsigned>(gpiod_chip_info_get_num_lines(chip.get()));
    for (unsigned offset = 0; offset < count; ++offset) {
      const auto line = made<LineInfoHandle>(gpiod_chip_get_line_info(chip_.get(), offset),
                                             "gpiod_chip_get_line_info");
      info.lines.push_back({textOf(gpiod_line_info_get_name(line.get())),
                            gpiod_line_info_is_used(line.get()),
                            textOf(gpiod_line_info_get_consumer(line.get()))});
    }
    return info;
  }

  std::unique_ptr<Outputs> requestOutputs(const std::vector<OutputLine>& lines) override {
    return std::make_unique<Outputs2>(chip_.get(), lines);
  }

  std::unique_ptr<Inputs> requestInputs(const std::vector<InputLine>& lines) override {
    return std::make_unique<Inputs2>(chip_.get(), lines);
  }

 private:
  ChipHandle chip_;
};

}  // namespace

std::unique_ptr<Chip> openChip(const std::string& path) { return std::make_unique<Chip2>(path); }

bool canBias() { return true; }

std::string version() { return gpiod_api_version(); }

}  // namespace stepdriver::gpio::gpiod
