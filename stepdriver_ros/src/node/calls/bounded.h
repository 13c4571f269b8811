#pragma once

#include <fmt/format.h>
#include <ros/message_traits.h>
#include <ros/node_handle.h>
#include <ros/serialization.h>
#include <ros/service_traits.h>

#include <boost/function.hpp>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// A message M as it is read from a client that may be wrong or hostile. roscpp's own reader
/// reserves memory for as many elements as an array claims to have, before it looks whether the
/// bytes for them have come: four bytes then cost gigabytes, and the whole node if there are none.
///
/// Use it in place of M as the type that is subscribed or requested. A message that claims too much
/// is refused: a service's client gets the error, for a topic it is logged.
template <typename M>
struct Bounded : M {};

/// An array of texts has at most this many: they are names of axes and joints.
constexpr std::uint32_t kMostNames = 1000;
/// Any other array.
constexpr std::uint32_t kMostElements = 1'000'000;

/// Reads the bytes of a message like ros::serialization::IStream, but checks the length of each
/// array before it makes room for it.
class BoundedStream : public ros::serialization::Stream {
 public:
  static constexpr auto stream_type = ros::serialization::stream_types::Input;

  BoundedStream(std::uint8_t* data, std::uint32_t size) : Stream(data, size) {}

  /// @throw Refused if an array claims more elements than there are bytes for, or than allowed.
  /// @throw ros::serialization::StreamOverrunException if the message ends too early.
  template <typename T>
  void next(T& value) {
    ros::serialization::Serializer<T>::read(*this, value);
  }

  template <typename T, typename Allocator>
  void next(std::vector<T, Allocator>& values) {
    std::uint32_t count = 0;
    next(count);
    check(count, std::is_same_v<T, std::string> ? kMostNames : kMostElements,
          ros::serialization::serializationLength(T()));
    values.resize(count);
    if constexpr (std::is_arithmetic_v<T>) {
      const auto bytes = static_cast<std::uint32_t>(count * sizeof(T));
      if (count > 0) std::memcpy(values.data(), advance(bytes), bytes);
    } else {
      for (T& value : values) next(value);
    }
  }

 private:
  /// @param least bytes of an element.
  void check(std::uint32_t count, std::uint32_t most, std::uint32_t least) {
    if (count > getLength() / least) {
      throw Refused(fmt::format(
          "the message claims an array of {} elements, but only {} more bytes have come", count,
          getLength()));
    }
    if (count > most) {
      throw Refused(fmt::format("the message has an array of {} elements; at most {} are allowed",
                                count, most));
    }
  }
};

/// Advertises a service whose request is read as Bounded.
template <typename Request, typename Response>
ros::ServiceServer advertiseBounded(ros::NodeHandle& node, const std::string& name,
                                    const boost::function<bool(Request&, Response&)>& handler) {
  return node.advertiseService(name, boost::function<bool(Bounded<Request>&, Response&)>(handler));
}

}  // namespace stepdriver::ros_node

namespace ros {

namespace serialization {
template <typename M>
struct Serializer<stepdriver::ros_node::Bounded<M>> {
  template <typename Input>
  static void read(Input& stream, stepdriver::ros_node::Bounded<M>& message) {
    stepdriver::ros_node::BoundedStream bounded(stream.getData(), stream.getLength());
    Serializer<M>::read(bounded, static_cast<M&>(message));
    stream.advance(stream.getLength() - bounded.getLength());
  }
};
}  // namespace serialization

namespace message_traits {
template <typename M>
struct IsMessage<stepdriver::ros_node::Bounded<M>> : IsMessage<M> {};
template <typename M>
struct MD5Sum<stepdriver::ros_node::Bounded<M>> : MD5Sum<M> {};
template <typename M>
struct DataType<stepdriver::ros_node::Bounded<M>> : DataType<M> {};
template <typename M>
struct Definition<stepdriver::ros_node::Bounded<M>> : Definition<M> {};
}  // namespace message_traits

namespace service_traits {
template <typename M>
struct MD5Sum<stepdriver::ros_node::Bounded<M>> : MD5Sum<M> {};
template <typename M>
struct DataType<stepdriver::ros_node::Bounded<M>> : DataType<M> {};
}  // namespace service_traits

}  // namespace ros
