#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/paced_run.h"

// Runs the engine against the steady clock, on free lines, and measures how late its edges are.

namespace stepdriver::bench {
namespace {

constexpr const char* kUsage = R"(usage: paced [--seconds S] [--quick | --pairs N] [--json FILE]

Drives 1, 3 and 6 axes at 1 to 40 thousand steps/s against the steady clock, on lines that cost
nothing, with an idle machine and with all its cores busy; beside it a plain loop of
clock_nanosleep() at the same rates. Prints how late the edges came [us], their shortest interval
[us], and what a motor made of them: the largest lag of its rotor [electrical degrees], and the full
steps that it lost. Exit code 1 where a pulse or a pause was shorter than the chip's time, or a step
came before its time.

  --seconds S  of each run; default: 1
  --quick      a few runs only
  --pairs N    in place of all that: N runs of 1 axis at 1 to 16 thousand steps/s and of 6 axes at
               8 thousand, each in turn with realtime/late_steps 0 and 0.25, idle and busy. Prints
               the mean of each N, and the worst lag
  --json FILE  writes the figures there too
)";

struct Options {
  double seconds = 1.0;
  bool quick = false;
  int pairs = 0;
  std::string json;
};

struct Row {
  std::string what;
  PacedRun run;
  bool loaded = false;
  PacedFigures figures;

  bool sound() const { return figures.too_short == 0 && figures.early == 0; }
};

double us(pulse::Nanoseconds time) { return static_cast<double>(time) * 1e-3; }

void printHead() {
  std::printf("%-15s %4s %7s %5s %-6s %8s %8s %8s %8s %9s %6s %8s %8s %5s %5s %5s %5s %4s\n", "",
              "axes", "steps/s", "late", "cores", "edges", "p50", "p99", "p99.9", "max", "slips",
              "slid ms", "shortest", "short", "early", "cpu", "lag", "lost");
}

void print(const Row& row) {
  const PacedFigures& figures = row.figures;
  std::printf(
      "%-15s %4d %7.0f %5.2f %-6s %8zu %8.1f %8.1f %8.1f %9.1f %6llu %8.2f %8.1f %5zu %5zu %4.0f%% "
      "%5.1f %4lld\n",
      row.what.c_str(), row.run.axes, row.run.rate, row.run.late_steps,
      row.loaded ? "busy" : "idle", figures.edges, us(figures.percentile(0.5)),
      us(figures.percentile(0.99)), us(figures.percentile(0.999)), us(figures.percentile(1.0)),
      static_cast<unsigned long long>(figures.slips), static_cast<double>(figures.slipped) * 1e-6,
      us(figures.shortest), figures.too_short, figures.early, 100.0 * figures.cpu,
      figures.largest_lag, static_cast<long long>(figures.lost));
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
        "  {\"what\": \"%s\", \"axes\": %d, \"steps_per_s\": %.0f, \"late_steps\": %.2f, "
        "\"busy\": %s, \"edges\": %zu, "
        "\"late_us\": {\"p50\": %.3f, \"p99\": %.3f, \"p99.9\": %.3f, \"max\": %.3f}, "
        "\"slips\": %llu, \"slipped_ms\": %.6f, \"shortest_us\": %.3f, \"too_short\": %zu, "
        "\"early\": %zu, \"cpu\": %.4f, \"lag_degrees\": %.1f, \"lost_steps\": %lld}%s\n",
        row.what.c_str(), row.run.axes, row.run.rate, row.run.late_steps,
        row.loaded ? "true" : "false", figures.edges, us(figures.percentile(0.5)),
        us(figures.percentile(0.99)), us(figures.percentile(0.999)), us(figures.percentile(1.0)),
        static_cast<unsigned long long>(figures.slips), static_cast<double>(figures.slipped) * 1e-6,
        us(figures.shortest), figures.too_short, figures.early, figures.cpu, figures.largest_lag,
        static_cast<long long>(figures.lost), &row == &rows.back() ? "" : ",");
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
      const PacedRun plain{1, rate, options.seconds, 0.0};
      rows.push_back({"clock_nanosleep", plain, loaded, runNanosleep(rate, options.seconds)});
      print(rows.back());
      for (const int count : axes) {
        const PacedRun run{count, rate, options.seconds, 0.25};
        rows.push_back({"engine", run, loaded, runPaced(run)});
        print(rows.back());
      }
    }
  }
  return rows;
}

// Means over runs of the same kind.
struct Means {
  void add(const PacedRun& run, const PacedFigures& figures);
  void print(const char* cores) const;

  PacedRun run;
  double seconds = 0.0;
  double slips = 0.0;
  double slipped = 0.0;  // [s]
  double cpu = 0.0;
  double lag = 0.0;
  double worst_lag = 0.0;
  std::int64_t lost = 0;
  pulse::Nanoseconds shortest = pulse::kNever;
  std::vector<pulse::Nanoseconds> p50s, p99s;
};

void Means::add(const PacedRun& that, const PacedFigures& figures) {
  run = that;
  seconds += that.seconds;
  slips += static_cast<double>(figures.slips);
  slipped += static_cast<double>(figures.slipped) * 1e-9;
  cpu += figures.cpu;
  lag += figures.largest_lag;
  worst_lag = std::max(worst_lag, figures.largest_lag);
  lost += figures.lost;
  shortest = std::min(shortest, figures.shortest);
  p50s.push_back(figures.percentile(0.5));
  p99s.push_back(figures.percentile(0.99));
}

double medianUs(std::vector<pulse::Nanoseconds> values) {
  std::sort(values.begin(), values.end());
  return us(values[values.size() / 2]);
}

void Means::print(const char* cores) const {
  const auto runs = static_cast<double>(p50s.size());
  std::printf("%4d %7.0f %-6s %5.2f %9.2f %9.2f %8.1f %8.1f %8.1f %5.0f%% %8.1f %8.1f %6lld\n",
              run.axes, run.rate, cores, run.late_steps, slips / seconds, 1e3 * slipped / seconds,
              medianUs(p50s), medianUs(p99s), us(shortest), 100.0 * cpu / runs, lag / runs,
              worst_lag, static_cast<long long>(lost));
  std::fflush(stdout);
}

std::vector<Row> runPairs(const Options& options) {
  std::printf("%4s %7s %-6s %5s %9s %9s %8s %8s %8s %6s %8s %8s %6s\n", "axes", "steps/s", "cores",
              "late", "slips/s", "slid ms/s", "p50", "p99", "shortest", "cpu", "lag", "worst",
              "lost");
  std::vector<Row> rows;
  for (const bool loaded : {false, true}) {
    const auto load = loaded ? std::make_unique<Load>() : nullptr;
    for (const auto& [axes, rate] :
         {std::pair{1, 1e3}, {1, 2e3}, {1, 4e3}, {1, 8e3}, {1, 1.6e4}, {6, 8e3}}) {
      Means means[2];
      for (int pair = 0; pair < options.pairs; ++pair) {
        for (const int kind : {0, 1}) {
          const PacedRun run{axes, rate, options.seconds, 0.25 * kind};
          rows.push_back({"pairs", run, loaded, runPaced(run)});
          means[kind].add(run, rows.back().figures);
        }
      }
      for (const Means& mean : means) mean.print(loaded ? "busy" : "idle");
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
    } else if (std::strcmp(argv[i], "--pairs") == 0 && more) {
      options.pairs = std::atoi(argv[++i]);
      if (options.pairs < 1 || options.pairs > 1000) {
        std::fprintf(stderr, "paced: --pairs must be from 1 to 1000\n");
        std::exit(2);
      }
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
    if (options.pairs == 0) printHead();
    const std::vector<Row> rows = options.pairs > 0 ? runPairs(options) : runAll(options);
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
