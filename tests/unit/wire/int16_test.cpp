#include "proto/encodings/int16.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/unit/wire/sample_map.hpp"

namespace dtact::wire {
namespace {

using testing::ElementsAreArray;
using namespace std::string_literals;

const std::string kMapBytes = "\x00\x00\x01\x00\x03\x00\xfe\xff\xe8\x03\xe8\x03\x00\x80\x07\x00"s;

TEST(Int16, IsLittleEndian) {
  std::string bytes = "left over";
  encode_int16(kMap, bytes);
  EXPECT_EQ(bytes, kMapBytes);
}

TEST(Int16, ComesBack) {
  std::vector<std::int16_t> map;
  ASSERT_TRUE(decode_int16(kMapBytes, 4, 2, map));
  EXPECT_THAT(map, ElementsAreArray(kMap));
}

TEST(Int16, RefusesOtherSizes) {
  std::vector<std::int16_t> map;
  EXPECT_FALSE(decode_int16(kMapBytes, 4, 1, map));
  EXPECT_FALSE(decode_int16(kMapBytes, 5, 2, map));
  EXPECT_FALSE(decode_int16(kMapBytes.substr(1), 4, 2, map));
  EXPECT_FALSE(decode_int16("", 0, 0, map));
  EXPECT_FALSE(decode_int16("", 4, 0, map));
  // 2³² × 2³² wraps to nothing in 64 bits.
  EXPECT_FALSE(decode_int16("", std::size_t{1} << 32U, std::size_t{1} << 32U, map));
}

}  // namespace
}  // namespace dtact::wire
