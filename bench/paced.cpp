#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/paced_run.h"

// Runs the engine against the steady clock, on free lines, and measures how late its edges are.

namespace stepdriver::bench {
namespace {

constexpr const char* kUsage = R"(usage: paced [--seconds S] [--quick] [--json FILE]

Drives 1, 3 and 6 axes at 1 to 40 thousand steps/s against the steady clock, on lines that cost
nothing, with an idle machine and with all its cores busy; beside it a plain loop of
clock_nanosleep() at the same rates. Prints how late the edges came [us]. Exit code 1 where a pulse
or a pause was shorter than the chip's time, or steps came closer than the engine allows.

  --seconds S  of each run; default: 1
  --quick      a few runs only
  --json FILE  writes the figures there too
)";

struct Options {
  double seconds = 1.0;
  bool quick = false;
  std::string json;
};

struct Row {
  std::string what;
  int axes = 0;
  double rate = 0.0;
  bool loaded = false;
  PacedFigures figures;

  bool sound() const { return figures.too_short == 0 && figures.early == 0; }
};

double us(pulse::Nanoseconds time) { return static_cast<double>(time) * 1e-3; }

void printHead() {
  std::printf("%-15s %4s %7s %-6s %8s %9s %9s %9s %9s %6s %9s %6s %6s %5s\n", "", "axes", "steps/s",
              "cores", "edges", "p50", "p99", "p99.9", "max", "slips", "slid ms", "short", "early",
              "cpu");
}

void print(const Row& row) {
  const PacedFigures& figures = row.figures;
  std::printf("%-15s %4d %7.0f %-6s %8zu %9.1f %9.1f %9.1f %9.1f %6llu %9.2f %6zu %6zu %4.0f%%\n",
              row.what.c_str(), row.axes, row.rate, row.loaded ? "busy" : "idle", figures.edges,
              us(figures.percentile(0.5)), us(figures.percentile(0.99)),
              us(figures.percentile(0.999)), us(figures.percentile(1.0)),
              static_cast<unsigned long long>(figures.slips),
              static_cast<double>(figures.slipped) * 1e-6, figures.too_short, figures.early,
              100.0 * figures.cpu);
  std::fflush(stdout);
}

void write(const std::vector<Row>& rows, const std::string& file) {
  std::FILE* const json = std::fopen(file.c_str(), "w");
  if (json == nullptr) throw std::runtime_error(file + " can't be written");
  std::fprintf(json, "[\n");
  for (const Row& row : rows) {
    const PacedFigures& figures = row.figures;
    std::fprintf(
        json,
        "  {\"what\": \"%s\", \"axes\": %d, \"steps_per_s\": %.0f, \"busy\": %s, \"edges\": %zu, "
        "\"late_us\": {\"p50\": %.3f, \"p99\": %.3f, \"p99.9\": %.3f, \"max\": %.3f}, "
        "\"slips\": %llu, \"slipped_ms\": %.6f, \"too_short\": %zu, \"early\": %zu, "
        "\"cpu\": %.4f}%s\n",
        row.what.c_str(), row.axes, row.rate, row.loaded ? "true" : "false", figures.edges,
        us(figures.percentile(0.5)), us(figures.percentile(0.99)), us(figures.percentile(0.999)),
        us(figures.percentile(1.0)), static_cast<unsigned long long>(figures.slips),
        static_cast<double>(figures.slipped) * 1e-6, figures.too_short, figures.early, figures.cpu,
        &row == &rows.back() ? "" : ",");
  }
  std::fprintf(json, "]\n");
  std::fclose(json);
}

std::vector<Row> runAll(const Options& options) {
  const std::vector<int> axes = options.quick ? std::vector<int>{1, 6} : std::vector<int>{1, 3, 6};
  const std::vector<double> rates = options.quick
                                        ? std::vector<double>{1e3, 1e4}
                                        : std::vector<double>{1e3, 5e3, 1e4, 1.6e4, 2e4, 4e4};
  std::vector<Row> rows;
  for (const bool loaded : {false, true}) {
    const auto load = loaded ? std::make_unique<Load>() : nullptr;
    for (const double rate : rates) {
      rows.push_back({"clock_nanosleep", 1, rate, loaded, runNanosleep(rate, options.seconds)});
      print(rows.back());
      for (const int count : axes) {
        rows.push_back({"engine", count, rate, loaded, runPaced(count, rate, options.seconds)});
        print(rows.back());
      }
    }
  }
  return rows;
}

Options read(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const bool more = i + 1 < argc;
    if (std::strcmp(argv[i], "--seconds") == 0 && more) {
      options.seconds = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--quick") == 0) {
      options.quick = true;
    } else if (std::strcmp(argv[i], "--json") == 0 && more) {
      options.json = argv[++i];
    } else if (std::strcmp(argv[i], "--help") == 0) {
      std::printf("%s", kUsage);
      std::exit(0);
    } else {
      std::fprintf(stderr, "%s", kUsage);
      std::exit(2);
    }
  }
  if (!(options.seconds >= 0.01 && options.seconds <= 600.0)) {
    std::fprintf(stderr, "paced: --seconds must be from 0.01 to 600\n");
    std::exit(2);
  }
  return options;
}

}  // namespace
}  // namespace stepdriver::bench

int main(int argc, char** argv) {
  using namespace stepdriver::bench;
  const Options options = read(argc, argv);
  try {
    printHead();
    const std::vector<Row> rows = runAll(options);
    if (!options.json.empty()) write(rows, options.json);
    const bool fifo = rows.front().figures.scheduler_error == 0;
    std::printf("%s\n",
                fifo ? "SCHED_FIFO was granted." : "SCHED_FIFO was refused: ordinary priority.");
    for (const Row& row : rows) {
      if (!row.sound()) return 1;
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "paced: %s\n", error.what());
    return 1;
  }
}
