#include "proto/encodings/delta_zstd.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/wire/sample_map.hpp"

namespace dtact::wire {
namespace {

using testing::ElementsAreArray;
using namespace std::string_literals;

// By hand: 0 1 2 −5 | 1000 0 31768 (−33768 + 65536) 32775, little-endian.
const std::string kDifferences =
    "\x00\x00\x01\x00\x02\x00\xfb\xff\xe8\x03\x00\x00\x18\x7c\x07\x80"s;
// Those differences through the zstd command line, `zstd -1 --no-check`.
const std::string kZstd =
    "\x28\xb5\x2f\xfd\x20\x10\x81\x00\x00"
    "\x00\x00\x01\x00\x02\x00\xfb\xff\xe8\x03\x00\x00\x18\x7c\x07\x80"s;

TEST(DeltaZstd, CompressesLeftNeighbourDifferences) {
  std::string bytes = "left over";
  DeltaZstdEncoder encoder;
  encoder.encode(kMap, 4, bytes);
  std::string plain(100, '?');
  const std::size_t size = ZSTD_decompress(plain.data(), plain.size(), bytes.data(), bytes.size());
  ASSERT_EQ(ZSTD_isError(size), 0U);
  plain.resize(size);
  EXPECT_EQ(plain, kDifferences);
}

TEST(DeltaZstd, ReadsWhatTheCommandLineWrote) {
  std::vector<std::int16_t> map;
  ASSERT_TRUE(decode_delta_zstd(kZstd, 4, 2, map));
  EXPECT_THAT(map, ElementsAreArray(kMap));
}

TEST(DeltaZstd, ComesBackFromALargeMapTwice) {
  std::vector<std::int16_t> map(800 * 600);
  for (std::size_t i = 0; i < map.size(); ++i) {
    map[i] = i % 97 == 0 ? INT16_MIN : static_cast<std::int16_t>(i * i % 1999);
  }
  DeltaZstdEncoder encoder;
  std::string bytes;
  std::vector<std::int16_t> back;
  for (int time = 0; time < 2; ++time) {
    encoder.encode(map, 800, bytes);
    ASSERT_TRUE(decode_delta_zstd(bytes, 800, 600, back));
    EXPECT_EQ(back, map);
  }
}

TEST(DeltaZstd, AFlatMapIsSmall) {
  const std::vector<std::int16_t> map(800 * 600, 0);
  std::string bytes;
  DeltaZstdEncoder().encode(map, 800, bytes);
  EXPECT_LT(bytes.size(), 1000U);
}

TEST(DeltaZstd, MovesAndStillWorks) {
  DeltaZstdEncoder first;
  DeltaZstdEncoder second(std::move(first));
  std::string bytes;
  second.encode(kMap, 4, bytes);
  std::vector<std::int16_t> map;
  EXPECT_TRUE(decode_delta_zstd(bytes, 4, 2, map));
}

TEST(DeltaZstd, EncodesOnlyWholeRows) {
  std::string bytes;
  DeltaZstdEncoder encoder;
  EXPECT_THROW(encoder.encode(kMap, 3, bytes), std::invalid_argument);
  EXPECT_THROW(encoder.encode(kMap, 0, bytes), std::invalid_argument);
}

TEST(DeltaZstd, RefusesOtherSizes) {
  std::vector<std::int16_t> map;
  EXPECT_FALSE(decode_delta_zstd(kZstd, 4, 1, map));
  EXPECT_FALSE(decode_delta_zstd(kZstd, 4, 3, map));
  EXPECT_FALSE(decode_delta_zstd(kZstd, 0, 2, map));
  EXPECT_FALSE(decode_delta_zstd(kZstd, 1U << 31U, 1U << 31U, map));
}

TEST(DeltaZstd, RefusesDamage) {
  std::vector<std::int16_t> map;
  EXPECT_FALSE(decode_delta_zstd("", 4, 2, map));
  EXPECT_FALSE(decode_delta_zstd("not zstd at all", 4, 2, map));
  EXPECT_FALSE(decode_delta_zstd(kZstd + "more", 4, 2, map));
  // RFC 8878, 3.1.2: a skippable frame without content.
  EXPECT_FALSE(decode_delta_zstd(kZstd + "\x50\x2a\x4d\x18\0\0\0\0"s, 4, 2, map));
  for (std::size_t size = 0; size < kZstd.size(); ++size) {
    EXPECT_FALSE(decode_delta_zstd(kZstd.substr(0, size), 4, 2, map)) << size;
  }
}

}  // namespace
}  // namespace dtact::wire
