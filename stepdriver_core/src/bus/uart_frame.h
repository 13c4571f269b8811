#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

/// Serial ports, and the registers of driver chips that are reached over them.
namespace stepdriver::bus {

/// The datagrams of the single-wire UART of Trinamic's drivers (TMC2209 datasheet rev. 1.03,
/// section 4): 8N1, the low bit of a byte first.
constexpr std::uint8_t kSync = 0x05;
constexpr std::uint8_t kWriteBit = 0x80;
/// The address of the master, to which a chip answers.
constexpr std::uint8_t kMaster = 0xFF;

using ReadRequest = std::array<std::uint8_t, 4>;
using WriteFrame = std::array<std::uint8_t, 8>;
using Answer = std::array<std::uint8_t, 8>;

/// CRC-8 with the polynomial 07h, beginning with 0, over the bits of each byte from the low one on.
/// A value of 0 is as valid as any.
std::uint8_t crcOf(const std::uint8_t* bytes, std::size_t count);

ReadRequest readRequest(std::uint8_t address, std::uint8_t number);
WriteFrame writeFrame(std::uint8_t address, std::uint8_t number, std::uint32_t value);
/// What a chip answers to a read.
Answer answerOf(std::uint8_t number, std::uint32_t value);

/// The value in an answer of 8 bytes; empty if it isn't one of that register, or its CRC is wrong.
std::optional<std::uint32_t> valueOf(const std::uint8_t* bytes, std::uint8_t number);

}  // namespace stepdriver::bus
