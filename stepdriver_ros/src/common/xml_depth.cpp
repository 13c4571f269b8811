#include "xml_depth.h"

#include <xmlrpcpp/XmlRpcValue.h>

#include <stdexcept>
#include <string>

#include "library_function.h"

namespace {

using FromXml = bool (*)(XmlRpc::XmlRpcValue*, const std::string&, int*);

// The name of XmlRpc::XmlRpcValue::fromXml(const std::string&, int*) in the library.
constexpr char kFromXml[] =
    "_ZN6XmlRpc11XmlRpcValue7fromXmlERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEPi";

/// The library's own function.
FromXml libraryFromXml() {
  static const auto function = stepdriver::ros_node::libraryFunction<FromXml>(kFromXml);
  return function;
}

/// How deep this thread is in a value.
thread_local int depth = 0;

}  // namespace

/// Takes the place of the library's function, also for calls in the library.
bool XmlRpc::XmlRpcValue::fromXml(const std::string& valueXml, int* offset) {
  const FromXml read = libraryFromXml();
  if (read == nullptr || depth >= stepdriver::ros_node::kMostXmlDepth) {
    invalidate();
    return false;
  }
  ++depth;
  bool is_value = false;
  try {
    is_value = read(this, valueXml, offset);
  } catch (...) {
    --depth;
    throw;
  }
  --depth;
  return is_value;
}

namespace stepdriver::ros_node {

void limitXmlDepth() {
  if (libraryFromXml() == nullptr) {
    throw std::runtime_error(std::string("the library xmlrpcpp has no function ") + kFromXml);
  }
}

}  // namespace stepdriver::ros_node
