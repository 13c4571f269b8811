#include "watch.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace stepdriver::soak {
namespace {

constexpr std::int64_t kMostGrowthKilobytes = 8192;

std::int64_t kilobytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t all = 0;
  std::int64_t resident = 0;
  file >> all >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

std::int64_t descriptors() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return std::distance(begin(files), end(files));
}

}  // namespace

Watch::Watch(double warm) : warm_(warm), begin_(std::chrono::steady_clock::now()) {}

double Watch::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

void Watch::look(const Findings& findings) {
  if (first_kilobytes_ == 0 && seconds() > warm_) {
    first_kilobytes_ = kilobytes();
    first_descriptors_ = descriptors();
  }
  if (seconds() < 60.0 * (minutes_ + 1)) return;
  ++minutes_;
  print(findings);
}

void Watch::print(const Findings& findings) {
  const double now = seconds();
  const double rate = static_cast<double>(findings.edges - edges_printed_) / (now - printed_at_);
  edges_printed_ = findings.edges;
  printed_at_ = now;
  std::printf(
      "%6.1f min: %.4g edges (%.3g/s), %lld violations, %lld mismatches, %lld errors, %lld kB, "
      "%lld descriptors\n",
      now / 60.0, static_cast<double>(findings.edges), rate,
      static_cast<long long>(findings.violations), static_cast<long long>(findings.mismatches),
      static_cast<long long>(findings.errors), static_cast<long long>(kilobytes()),
      static_cast<long long>(descriptors()));
  std::fflush(stdout);
}

int Watch::conclude(const Findings& findings, const Counts& counts) {
  print(findings);
  for (const auto& [kind, count] : counts) {
    std::printf("  %-15s %10lld accepted %10lld refused\n", kind.c_str(),
                static_cast<long long>(count.accepted), static_cast<long long>(count.refused));
  }
  const std::int64_t growth = first_kilobytes_ == 0 ? 0 : kilobytes() - first_kilobytes_;
  const std::int64_t more = first_kilobytes_ == 0 ? 0 : descriptors() - first_descriptors_;
  const bool flat = growth <= kMostGrowthKilobytes && more <= 0;
  const bool good = findings.good() && flat && findings.edges > 0;
  std::printf(
      "%s: %llu edges in %.0f s, %lld violations, %lld mismatches, %lld errors; since its "
      "first %.0f s it grew by %lld kB and %lld descriptors\n",
      good ? "good" : "FAILED", static_cast<unsigned long long>(findings.edges), seconds(),
      static_cast<long long>(findings.violations), static_cast<long long>(findings.mismatches),
      static_cast<long long>(findings.errors), warm_, static_cast<long long>(growth),
      static_cast<long long>(more));
  return good ? 0 : 1;
}

}  // namespace stepdriver::soak
