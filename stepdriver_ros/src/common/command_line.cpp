#include "command_line.h"

#include <fmt/format.h>

#include <boost/lexical_cast/try_lexical_convert.hpp>
#include <boost/program_options/errors.hpp>
#include <boost/program_options/option.hpp>
#include <boost/program_options/parsers.hpp>

#include "stepdriver_core/error.h"

namespace stepdriver {

namespace po = boost::program_options;

po::variables_map readCommandLine(const po::options_description& known,
                                  const std::vector<std::string>& arguments,
                                  const std::string& meant) {
  namespace style = po::command_line_style;
  po::variables_map options;
  try {
    const po::parsed_options parsed = po::command_line_parser(arguments)
                                          .options(known)
                                          .style(style::unix_style & ~style::allow_guessing)
                                          .run();
    for (const po::option& option : parsed.options) {
      if (!option.string_key.empty()) continue;
      const std::string& word = option.value.front();
      throw Error(fmt::format("{} isn't an option; did you mean --{} {}?", word, meant, word));
    }
    po::store(parsed, options);
    po::notify(options);
  } catch (const po::error& error) {
    throw Error(error.what());
  }
  return options;
}

std::optional<double> findNumber(const po::variables_map& options, const std::string& name,
                                 const std::function<bool(double)>& allowed,
                                 const std::string& wanted) {
  if (options.count(name) == 0) return {};
  const auto& text = options[name].as<std::string>();
  double number = 0.0;
  if (!boost::conversion::try_lexical_convert(text, number) || !allowed(number)) {
    throw Error(fmt::format("--{} {}: it must be {}", name, text, wanted));
  }
  return number;
}

}  // namespace stepdriver
