#include "drivers_report.h"

namespace stepdriver::check {

std::string driversText(const std::vector<setup::DriverFinding>& findings) {
  std::string text;
  for (const setup::DriverFinding& finding : findings) {
    text += (finding.is_right ? "  ok     " : "  WRONG  ") + finding.text + "\n";
  }
  return text;
}

}  // namespace stepdriver::check
