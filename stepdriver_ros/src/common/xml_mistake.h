#pragma once

#include <string>

namespace stepdriver::ros_node {

/// Why a text can't be given to a reader of XML that is less careful: urdfdom's, libtinyxml, reads
/// beyond the end of malformed texts, and it reads nested elements by recursion.
///
/// @param xml in UTF-8, whatever it declares. It must be well-formed, with elements nested no
/// deeper
///   than libxml2 allows, and have no document type declaration: entities, which are defined there,
///   can expand to gigabytes or name other files.
/// @return the first mistake with its line and column, in one line; empty: there is none.
std::string mistakeInXml(const std::string& xml);

}  // namespace stepdriver::ros_node
