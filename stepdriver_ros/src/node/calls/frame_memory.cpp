#include "frame_memory.h"

#include <ros/connection.h>
#include <ros/console.h>

#include <atomic>
#include <boost/shared_array.hpp>
#include <memory>
#include <stdexcept>
#include <string>

#include "common/library_function.h"

namespace {

using stepdriver::ros_node::kMostFrameMemory;
using stepdriver::ros_node::kSmallFrame;

using Read = void (*)(ros::Connection*, std::uint32_t, const ros::ReadFinishedFunc&);

// The name of ros::Connection::read(std::uint32_t, const ros::ReadFinishedFunc&) in the library.
constexpr char kRead[] =
    "_ZN3ros10Connection4readEjRKN5boost8functionIFvRKNS1_10shared_ptrIS0_EERKNS1_12shared_"
    "arrayIhEEjbEEE";

/// The library's own function.
Read libraryRead() {
  static const auto function = stepdriver::ros_node::libraryFunction<Read>(kRead);
  return function;
}

std::atomic<std::uint64_t> claimed{0};

/// The memory of a message, for as long as the object lives.
class FrameClaim {
 public:
  explicit FrameClaim(std::uint32_t bytes)
      : bytes_(bytes), before_(claimed.fetch_add(bytes, std::memory_order_relaxed)) {}
  ~FrameClaim() { claimed.fetch_sub(bytes_, std::memory_order_relaxed); }
  FrameClaim(const FrameClaim&) = delete;
  FrameClaim& operator=(const FrameClaim&) = delete;

  std::uint64_t before() const { return before_; }
  bool fits() const { return before_ + bytes_ <= kMostFrameMemory; }

 private:
  const std::uint64_t bytes_;
  const std::uint64_t before_;  // what others had claimed
};

/// The same bytes, which keep the claim until nobody needs them.
boost::shared_array<std::uint8_t> withClaim(const boost::shared_array<std::uint8_t>& bytes,
                                            const std::shared_ptr<FrameClaim>& claim) {
  return boost::shared_array<std::uint8_t>(bytes.get(),
                                           [bytes, claim](const std::uint8_t* /*held*/) {});
}

}  // namespace

/// Takes the place of the library's function, also for calls in the library.
void ros::Connection::read(std::uint32_t size, const ReadFinishedFunc& finished_callback) {
  const Read read_on = libraryRead();
  if (size <= kSmallFrame) return read_on(this, size, finished_callback);
  const auto claim = std::make_shared<FrameClaim>(size);
  if (!claim->fits()) {
    ROS_WARN_THROTTLE_NAMED(
        1.0, "connections",
        "%s claims to send %u bytes, but all large messages together may have %llu, and others "
        "have claimed %llu of them: its connection is closed",
        getRemoteString().c_str(), size, static_cast<unsigned long long>(kMostFrameMemory),
        static_cast<unsigned long long>(claim->before()));
    return drop(TransportDisconnect);
  }
  read_on(this, size,
          [claim, finished_callback](const ConnectionPtr& connection,
                                     const boost::shared_array<std::uint8_t>& bytes,
                                     std::uint32_t received, bool complete) {
            finished_callback(connection, withClaim(bytes, claim), received, complete);
          });
}

namespace stepdriver::ros_node {

void limitFrameMemory() {
  if (libraryRead() == nullptr) {
    throw std::runtime_error(std::string("the library roscpp has no function ") + kRead);
  }
  if (!libraryCallsByName(kRead)) {
    ROS_WARN(
        "Large messages have no common limit: this roscpp, like Ubuntu's, calls its functions "
        "directly. A client that claims to send 1 GB can take the memory of this node");
  }
}

}  // namespace stepdriver::ros_node
