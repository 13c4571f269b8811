#pragma once

#include <cstdint>

namespace stepdriver::ros_node {

/// [bytes] All large messages together may claim this much. A message is large if it has more than
/// kSmallFrame.
constexpr std::uint64_t kMostFrameMemory = std::uint64_t{256} << 20;
constexpr std::uint32_t kSmallFrame = 64 << 10;

/// Before a message come four bytes with its length. roscpp reserves that much memory, up to 1 GB
/// for each connection, before the bytes have come: a few silent clients then take all of a limited
/// address space, and the node with it. Programs that refer to this function close the connection
/// of a client whose large message doesn't fit into kMostFrameMemory. The memory of a message
/// counts until it has been handled, or until its connection ends. If this roscpp can't be given
/// that limit because it calls its functions directly, a warning says so.
///
/// @throw std::runtime_error if this roscpp has no such function.
void limitFrameMemory();

}  // namespace stepdriver::ros_node
