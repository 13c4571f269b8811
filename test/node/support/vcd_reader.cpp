#include "support/vcd_reader.h"

#include <fstream>
#include <sstream>

namespace stepdriver::node_test {

std::int64_t Waveform::changesTo(bool level) const {
  std::int64_t changes = 0;
  for (std::size_t i = 1; i < edges.size(); ++i) changes += edges[i].level == level ? 1 : 0;
  return changes;
}

std::map<std::string, Waveform> readVcd(const std::string& path) {
  std::map<std::string, Waveform> waveforms;
  std::map<std::string, std::string> names;  // identifier -> name
  std::ifstream file(path);
  std::string scope;
  std::int64_t time = 0;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string first;
    words >> first;
    if (first == "$scope") {
      words >> first >> scope;
    } else if (first == "$var") {
      std::string type;
      std::string width;
      std::string id;
      std::string variable;
      words >> type >> width >> id >> variable;
      names[id] = std::string(scope).append("/").append(variable);
    } else if (first == "$comment") {
      std::string pin;
      std::string level;
      words >> pin >> first >> level;
      const auto dot = pin.rfind('.');
      if (level != "both" || dot == std::string::npos) continue;
      waveforms[pin.substr(0, dot) + "/" + pin.substr(dot + 1)].both_edges = true;
    } else if (!first.empty() && first[0] == '#') {
      time = std::stoll(first.substr(1));
    } else if (!first.empty() && (first[0] == '0' || first[0] == '1')) {
      waveforms[names.at(first.substr(1))].edges.push_back({time, first[0] == '1'});
    }
  }
  return waveforms;
}

}  // namespace stepdriver::node_test
