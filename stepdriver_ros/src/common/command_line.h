#pragma once

#include <boost/program_options/options_description.hpp>
#include <boost/program_options/variables_map.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver {

/// Reads the arguments of a program: long options by their whole names, short ones, and nothing
/// else. Fills in what the descriptions point to.
///
/// @throw Error where they can't be understood.
boost::program_options::variables_map readCommandLine(
    const boost::program_options::options_description& known,
    const std::vector<std::string>& arguments);

/// The value of an option that has a string's; none where it wasn't given.
///
/// @param allowed says it of a number. @param wanted the same in words.
/// @throw Error where it isn't an allowed number.
std::optional<double> findNumber(const boost::program_options::variables_map& options,
                                 const std::string& name,
                                 const std::function<bool(double)>& allowed,
                                 const std::string& wanted);

}  // namespace stepdriver
