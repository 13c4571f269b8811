#pragma once

#include <boost/program_options/options_description.hpp>
#include <boost/program_options/variables_map.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver {

/// Reads the arguments of a program: long options with their full names, short options, and nothing
/// else. Fills in the variables of the descriptions.
///
/// @param meant the option to suggest for a word without an option.
/// @throw Error if they can't be understood.
boost::program_options::variables_map readCommandLine(
    const boost::program_options::options_description& known,
    const std::vector<std::string>& arguments, const std::string& meant);

/// The value of an option that was read as a string; empty if it wasn't given.
///
/// @param allowed whether a number is allowed. @param wanted the same in words.
/// @throw Error if it isn't an allowed number.
std::optional<double> findNumber(const boost::program_options::variables_map& options,
                                 const std::string& name,
                                 const std::function<bool(double)>& allowed,
                                 const std::string& wanted);

}  // namespace stepdriver
