#include "proto/encodings/rvl.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "proto/encodings/map_size.hpp"
#include "tests/unit/wire/sample_map.hpp"

namespace dtact::wire {
namespace {

using testing::ElementsAreArray;
using namespace std::string_literals;

// By hand, from the paper's listing: 1 zero, 7 others; their differences 1 2 −5 1002 0 −33768 32775
// as zigzag 2 4 9 2004 0 67535 65550; nibbles 1 7 2 4 91 CAF3 0 F9FB82 E98882, filled up with 0.
const std::string kBytes = "\xca\x91\x24\x17\xb8\x9f\x0f\xf3\x20\x88\x98\x2e"s;

std::string encoded(const std::vector<std::int16_t>& map) {
  std::string bytes = "left over";
  RvlEncoder().encode(map, bytes);
  return bytes;
}

bool decodes(std::string_view bytes, std::size_t width, std::size_t height) {
  std::vector<std::int16_t> map;
  return decode_rvl(bytes, width, height, map);
}

TEST(Rvl, IsThePapersListing) { EXPECT_EQ(encoded(kMap), kBytes); }

TEST(Rvl, ComesBack) {
  std::vector<std::int16_t> map;
  ASSERT_TRUE(decode_rvl(kBytes, 4, 2, map));
  EXPECT_THAT(map, ElementsAreArray(kMap));
}

TEST(Rvl, KeepsThePreviousValueAcrossZeros) {
  // 0 zeros, 1 value (5, zigzag 10: nibbles A 1), 2 zeros, 1 value (5 again: 0): 01A1 210.
  EXPECT_EQ(encoded({5, 0, 0, 5}), "\x00\x21\xa1\x01"s);
}

TEST(Rvl, CutsLongRunsIntoGroupsOfThreeBits) {
  // 1000 zeros are 1 111 101 000: nibbles 8 D F 1, the lowest first; then 0 values.
  EXPECT_EQ(encoded(std::vector<std::int16_t>(1000)), "\x00\x00\xf1\x8d"s);
}

TEST(Rvl, HoldsTheWorstMaps) {
  // Each value the furthest from the one before, alone or beside others.
  for (const std::size_t zeros : {0U, 1U}) {
    std::vector<std::int16_t> map;
    for (int i = 0; i < 1001; ++i) {
      map.push_back(i % 2 == 0 ? INT16_MIN : INT16_MAX);
      map.insert(map.end(), zeros, 0);
    }
    std::vector<std::int16_t> back;
    ASSERT_TRUE(decode_rvl(encoded(map), map.size(), 1, back));
    EXPECT_EQ(back, map);
  }
}

TEST(Rvl, UsesItsScratchAgain) {
  RvlEncoder encoder;
  std::string bytes;
  encoder.encode(std::vector<std::int16_t>(5000, 77), bytes);
  encoder.encode(kMap, bytes);
  EXPECT_EQ(bytes, kBytes);
}

TEST(Rvl, RefusesMapsAboveTheCap) {
  std::string bytes;
  EXPECT_THROW(RvlEncoder().encode(std::vector<std::int16_t>(kMaxPixels + 1), bytes),
               std::length_error);
}

TEST(Rvl, RefusesOtherSizes) {
  EXPECT_TRUE(decodes(kBytes, 8, 1));
  EXPECT_FALSE(decodes(kBytes, 4, 1));
  EXPECT_FALSE(decodes(kBytes, 4, 3));
  EXPECT_FALSE(decodes(kBytes, 0, 2));
  EXPECT_FALSE(decodes(kBytes, std::size_t{1} << 32U, std::size_t{1} << 32U));
  EXPECT_FALSE(decodes("", 1, 1));
}

TEST(Rvl, RefusesDamage) {
  for (std::size_t size = 0; size < kBytes.size(); ++size) {
    EXPECT_FALSE(decodes(kBytes.substr(0, size), 4, 2)) << size;
  }
  EXPECT_FALSE(decodes(kBytes + "\0\0\0\0"s, 4, 2));  // words that nobody needs
  EXPECT_FALSE(
      decodes("\xca\x91\x24\x17\xb8\x9f\x0f\xf3\x21\x88\x98\x2e"s, 4, 2));  // not filled up with 0
}

TEST(Rvl, RefusesWhatNoEncoderWrites) {
  const auto word = [](std::uint32_t nibbles) {
    return std::string(reinterpret_cast<const char*>(&nibbles), sizeof nibbles);
  };
  EXPECT_TRUE(decodes(word(0x12200000), 3, 1));   // 1 zero, values 1 2
  EXPECT_FALSE(decodes(word(0x12200000), 2, 1));  // more values than pixels
  EXPECT_FALSE(decodes(word(0x40000000), 3, 1));  // more zeros than pixels
  EXPECT_FALSE(decodes(word(0x10120000), 2, 1));  // no value, and pixels are left
  EXPECT_FALSE(decodes(word(0x01201200), 2, 1));  // no zero between two values
  EXPECT_FALSE(decodes(word(0x12210000), 3, 1));  // a value of 0 (1 − 1)
  EXPECT_FALSE(decodes(word(0x90220000), 3, 1));  // 1 zero in two nibbles
  EXPECT_FALSE(decodes(word(0x88888888) + word(0x88880000), 3, 1));  // no end
  // 32768: 0 zeros, 1 value of zigzag 65536.
  EXPECT_FALSE(decodes(word(0x01888882), 1, 1));
}

}  // namespace
}  // namespace dtact::wire
