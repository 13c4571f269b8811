#include <gpiod.h>
#include <poll.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "gpiod_calls.h"

// libgpiod 1.4 to 1.6. Flags apply to a whole request, so all inputs with the same bias share one;
// a line with edges always has its own. In a request with several lines, gpiod_line_set_value()
// zeroes the other lines and gpiod_line_get_value() reads the first one. The whole request is
// therefore always set and read.

namespace stepdriver::gpio::gpiod {
namespace {

static_assert(kMostLines == GPIOD_LINE_BULK_MAX_LINES);

[[noreturn]] void fail(const char* call) {
  throw std::system_error(errno, std::generic_category(), call);
}

struct CloseChip {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};
using ChipHandle = std::unique_ptr<gpiod_chip, CloseChip>;

int flagsOf(Bias bias) {
#ifdef STEPDRIVER_GPIOD_BIAS
  switch (bias) {
    case Bias::kPullUp:
      return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
    case Bias::kPullDown:
      return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
    case Bias::kDisabled:
      return GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
    case Bias::kAsIs:
      break;
  }
#endif
  static_cast<void>(bias);
  return 0;
}

/// Lines of one request, from one chip.
class Bulk {
 public:
  Bulk() { gpiod_line_bulk_init(&lines_); }
  Bulk(const Bulk&) = delete;
  Bulk& operator=(const Bulk&) = delete;
  ~Bulk() {
    if (held_) gpiod_line_release_bulk(&lines_);
  }

  int add(gpiod_chip* chip, unsigned offset) {
    gpiod_line* const line = gpiod_chip_get_line(chip, offset);
    if (line == nullptr) fail("gpiod_chip_get_line");
    gpiod_line_bulk_add(&lines_, line);
    return static_cast<int>(gpiod_line_bulk_num_lines(&lines_)) - 1;
  }

  void request(int type, int flags, const int* levels = nullptr) {
    gpiod_line_request_config config{};
    config.consumer = kConsumer;
    config.request_type = type;
    config.flags = flags;
    if (gpiod_line_request_bulk(&lines_, &config, levels) < 0) fail("gpiod_line_request_bulk");
    held_ = true;
  }

  int set(LineBits levels) noexcept {
    std::array<int, kMostLines> values;
    for (std::size_t i = 0; i < kMostLines; ++i) values[i] = (levels & bitOf(i)) != 0 ? 1 : 0;
    return gpiod_line_set_value_bulk(&lines_, values.data()) < 0 ? errno : 0;
  }

  int get(int index) noexcept {
    std::array<int, kMostLines> levels;
    if (gpiod_line_get_value_bulk(&lines_, levels.data()) < 0) return -errno;
    return levels[static_cast<std::size_t>(index)];
  }

  /// Only for a request of one line with edges.
  int edgeFd() { return gpiod_line_event_get_fd(gpiod_line_bulk_get_line(&lines_, 0)); }

 private:
  gpiod_line_bulk lines_;
  bool held_ = false;
};

class Outputs1 : public Outputs {
 public:
  Outputs1(gpiod_chip* chip, const std::vector<OutputLine>& lines) {
    std::vector<int> levels;
    for (const OutputLine& line : lines) {
      bulk_.add(chip, line.offset);
      levels.push_back(line.level ? 1 : 0);
    }
    bulk_.request(GPIOD_LINE_REQUEST_DIRECTION_OUTPUT, 0, levels.data());
  }

  int set(LineBits /*lines*/, LineBits levels) noexcept override { return bulk_.set(levels); }

 private:
  Bulk bulk_;
};

class Inputs1 : public Inputs {
 public:
  Inputs1(gpiod_chip* chip, const std::vector<InputLine>& lines) : lines_(lines.size()) {
    for (const Bias bias : {Bias::kAsIs, Bias::kPullUp, Bias::kPullDown, Bias::kDisabled}) {
      auto plain = std::make_unique<Bulk>();
      bool any = false;
      for (std::size_t i = 0; i < lines.size(); ++i) {
        if (lines[i].bias != bias || lines[i].edges) continue;
        any = true;
        lines_[i] = {plain.get(), plain->add(chip, lines[i].offset)};
      }
      if (!any) continue;
      plain->request(GPIOD_LINE_REQUEST_DIRECTION_INPUT, flagsOf(bias));
      bulks_.push_back(std::move(plain));
    }
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!lines[i].edges) continue;
      auto single = std::make_unique<Bulk>();
      lines_[i] = {single.get(), single->add(chip, lines[i].offset)};
      single->request(GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES, flagsOf(lines[i].bias));
      edge_fds_.push_back(single->edgeFd());
      edge_lines_.push_back(static_cast<int>(i));
      bulks_.push_back(std::move(single));
    }
  }

  int get(int line) noexcept override {
    const Place& place = lines_[static_cast<std::size_t>(line)];
    return place.bulk->get(place.index);
  }

  const std::vector<int>& edgeFds() const override { return edge_fds_; }

  // All that are there, so that a level which is read afterwards isn't older than an edge which is
  // taken later. A call of libgpiod 1.4 reads one.
  int takeEdges(std::size_t fd, EdgeEvent* edges, std::size_t capacity) noexcept override {
    std::size_t count = 0;
    do {
      gpiod_line_event event{};
      if (gpiod_line_event_read_fd(edge_fds_[fd], &event) < 0) {
        return count > 0 ? static_cast<int>(count) : -errno;
      }
      edges[count++] = {edge_lines_[fd], event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
                        std::int64_t{event.ts.tv_sec} * 1'000'000'000 + event.ts.tv_nsec};
    } while (count < capacity && hasMore(edge_fds_[fd]));
    return static_cast<int>(count);
  }

 private:
  static bool hasMore(int fd) noexcept {
    pollfd polled{fd, POLLIN, 0};
    return poll(&polled, 1, 0) > 0 && (polled.revents & POLLIN) != 0;
  }

  struct Place {
    Bulk* bulk;
    int index;
  };

  std::vector<std::unique_ptr<Bulk>> bulks_;
  std::vector<Place> lines_;
  std::vector<int> edge_fds_;
  std::vector<int> edge_lines_;  // the line of each fd
};

std::string textOf(const char* text) { return text == nullptr ? "" : text; }

class Chip1 : public Chip {
 public:
  explicit Chip1(const std::string& path) : chip_(gpiod_chip_open(path.c_str())) {
    if (chip_ == nullptr) fail("gpiod_chip_open");
  }

  ChipInfo info() override {
    ChipInfo info;
    info.name = textOf(gpiod_chip_name(chip_.get()));
    info.label = textOf(gpiod_chip_label(chip_.get()));
    const unsigned count = gpiod_chip_num_lines(chip_.get());
    for (unsigned offset = 0; offset < count; ++offset) {
      gpiod_line* const line = gpiod_chip_get_line(chip_.get(), offset);
      if (line == nullptr || gpiod_line_update(line) < 0) fail("gpiod_chip_get_line");
      info.lines.push_back({textOf(gpiod_line_name(line)), gpiod_line_is_used(line),
                            textOf(gpiod_line_consumer(line))});
    }
    return info;
  }

  std::unique_ptr<Outputs> requestOutputs(const std::vector<OutputLine>& lines) override {
    return std::make_unique<Outputs1>(chip_.get(), lines);
  }

  std::unique_ptr<Inputs> requestInputs(const std::vector<InputLine>& lines) override {
    return std::make_unique<Inputs1>(chip_.get(), lines);
  }

 private:
  ChipHandle chip_;
};

}  // namespace

std::unique_ptr<Chip> openChip(const std::string& path) { return std::make_unique<Chip1>(path); }

bool canBias() {
#ifdef STEPDRIVER_GPIOD_BIAS
  return true;
#else
  return false;
#endif
}

std::string version() { return gpiod_version_string(); }

}  // namespace stepdriver::gpio::gpiod
