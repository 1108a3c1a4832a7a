#include "proto/encodings/predict_zstd.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/wire/sample_map.hpp"

namespace dtact::wire {
namespace {

using testing::ElementsAreArray;
using namespace std::string_literals;

// Residuals by hand: 0 1 2 −5 | 1000 −1 −33770 (+ 65536) 32780 (− 65536), as zigzag 0 2 4 9 | 2000
// 1 63532 65511: four nibbles, 15, 1, 15, 15, and what the three 15 stand for.
const std::string kContent = "\x20\x94\x1f\xff\xff\xd0\x07\xff\x2c\xf8\xff\xe7\xff"s;

std::string content_of(const std::string& frame) {
  std::string content(10000, '?');
  const std::size_t size =
      ZSTD_decompress(content.data(), content.size(), frame.data(), frame.size());
  EXPECT_EQ(ZSTD_isError(size), 0U);
  content.resize(size);
  return content;
}

std::string frame_of(std::string_view content) {
  std::string frame(ZSTD_compressBound(content.size()), '?');
  frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), content.size(), 1));
  return frame;
}

std::string encoded_content(const std::vector<std::int16_t>& map, std::size_t width) {
  std::string bytes = "left over";
  PredictZstdEncoder().encode(map, width, bytes);
  return content_of(bytes);
}

bool decodes_content(std::string_view content, std::size_t width, std::size_t height) {
  std::vector<std::int16_t> map;
  return decode_predict_zstd(frame_of(content), width, height, map);
}

TEST(PredictZstd, HoldsNibblesAndWhatDoesNotFitThem) {
  EXPECT_EQ(encoded_content(kMap, 4), kContent);
}

TEST(PredictZstd, ReadsThem) {
  std::vector<std::int16_t> map;
  ASSERT_TRUE(decode_predict_zstd(frame_of(kContent), 4, 2, map));
  EXPECT_THAT(map, ElementsAreArray(kMap));
}

TEST(PredictZstd, ChangesItsFormAt15And270) {
  // Zigzag 14, 15, 269, 270 and, in half a byte of its own, 2.
  EXPECT_EQ(encoded_content({7, -1, -136, -1, 0}, 5), "\xfe\xff\x02\x00\xfe\xff\x0e\x01"s);
}

TEST(PredictZstd, FindsEscapesEverywhere) {
  for (std::size_t width = 1; width < 40; ++width) {
    std::vector<std::int16_t> map(3 * width);
    for (std::size_t i = 0; i < map.size(); ++i) {
      map[i] = static_cast<std::int16_t>(i % 5 == 0 ? 300 * i : i % 7);
    }
    std::string bytes;
    PredictZstdEncoder().encode(map, width, bytes);
    std::vector<std::int16_t> back;
    ASSERT_TRUE(decode_predict_zstd(bytes, width, 3, back)) << width;
    EXPECT_EQ(back, map) << width;
  }
}

TEST(PredictZstd, ComesBackFromMapsOfManySizesWithOneEncoder) {
  PredictZstdEncoder encoder;
  std::string bytes;
  std::vector<std::int16_t> back;
  for (const auto& [width, height] : {std::pair{800, 600}, {33, 7}, {1, 1}, {801, 3}}) {
    std::vector<std::int16_t> map(static_cast<std::size_t>(width * height));
    for (std::size_t i = 0; i < map.size(); ++i) {
      map[i] = i % 97 == 0 ? INT16_MIN : static_cast<std::int16_t>(i * i % 1999);
    }
    encoder.encode(map, static_cast<std::size_t>(width), bytes);
    ASSERT_TRUE(decode_predict_zstd(bytes, static_cast<std::size_t>(width),
                                    static_cast<std::size_t>(height), back));
    EXPECT_EQ(back, map);
  }
}

TEST(PredictZstd, AFlatMapIsSmall) {
  const std::vector<std::int16_t> map(800 * 600, 0);
  std::string bytes;
  PredictZstdEncoder().encode(map, 800, bytes);
  EXPECT_LT(bytes.size(), 100U);
}

TEST(PredictZstd, ANoisyBallTakesLessThanHalfOfItsNibbles) {
  // A slope with noise as smooth as the reconstruction's filter leaves it: 14,211 bytes. Without
  // its entropy code zstd would need half a byte a pixel, 32,768.
  std::mt19937 random(3);
  constexpr std::size_t kSide = 256;
  constexpr std::size_t kStride = kSide + 16;
  std::vector<double> noise(kStride * kStride);
  for (double& value : noise) value = static_cast<double>(random() % 1000) / 1000 - 0.5;
  for (const std::size_t step : {std::size_t{1}, kStride}) {
    for (int round = 0; round < 6; ++round) {
      for (std::size_t i = 0; i + 16 * step < noise.size(); ++i) {
        noise[i] = (noise[i] + noise[i + step] + noise[i + 2 * step]) / 3;
      }
    }
  }
  std::vector<std::int16_t> map;
  for (std::size_t y = 0; y < kSide; ++y) {
    for (std::size_t x = 0; x < kSide; ++x) {
      const double r = std::hypot(static_cast<double>(x) - 128, static_cast<double>(y) - 128);
      map.push_back(
          static_cast<std::int16_t>(std::lround(1200 - r * r / 14 + 100 * noise[y * kStride + x])));
    }
  }
  std::string bytes;
  PredictZstdEncoder().encode(map, kSide, bytes);
  EXPECT_LT(bytes.size(), 15500U);
}

TEST(PredictZstd, MovesAndStillWorks) {
  PredictZstdEncoder first;
  PredictZstdEncoder second(std::move(first));
  std::string bytes;
  second.encode(kMap, 4, bytes);
  EXPECT_EQ(content_of(bytes), kContent);
}

TEST(PredictZstd, EncodesOnlyWholeRows) {
  std::string bytes;
  PredictZstdEncoder encoder;
  EXPECT_THROW(encoder.encode(kMap, 3, bytes), std::invalid_argument);
  EXPECT_THROW(encoder.encode(kMap, 0, bytes), std::invalid_argument);
}

TEST(PredictZstd, RefusesOtherSizes) {
  EXPECT_TRUE(decodes_content(kContent, 8, 1));
  EXPECT_FALSE(decodes_content(kContent, 4, 1));
  EXPECT_FALSE(decodes_content(kContent, 4, 3));
  EXPECT_FALSE(decodes_content(kContent, 0, 2));
  EXPECT_FALSE(decodes_content(kContent, 1U << 31U, 1U << 31U));
  EXPECT_FALSE(decodes_content("", 1, 1));
}

TEST(PredictZstd, RefusesDamage) {
  const std::string frame = frame_of(kContent);
  std::vector<std::int16_t> map;
  EXPECT_FALSE(decode_predict_zstd("", 4, 2, map));
  EXPECT_FALSE(decode_predict_zstd("not zstd at all", 4, 2, map));
  EXPECT_FALSE(decode_predict_zstd(frame + "more", 4, 2, map));
  // RFC 8878, 3.1.2: a skippable frame without content.
  EXPECT_FALSE(decode_predict_zstd(frame + "\x50\x2a\x4d\x18\0\0\0\0"s, 4, 2, map));
  for (std::size_t size = 0; size < frame.size(); ++size) {
    EXPECT_FALSE(decode_predict_zstd(frame.substr(0, size), 4, 2, map)) << size;
  }
}

TEST(PredictZstd, DoesNotBelieveAnySizeThatAFrameStates) {
  // RFC 8878, 3.1.1.1: one segment, its content's size in eight bytes.
  std::vector<std::int16_t> map;
  const std::string head = "\x28\xb5\x2f\xfd\xe0"s;
  EXPECT_FALSE(decode_predict_zstd(head + "\0\0\0\0\0\1\0\0"s, 4, 2, map));  // a terabyte
  EXPECT_FALSE(decode_predict_zstd(head + "\0\0\0\0\0\0\0\x7f"s, 4, 2, map));
}

TEST(PredictZstd, RefusesWhatNoEncoderWrites) {
  EXPECT_TRUE(decodes_content("\x12"s, 2, 1));
  EXPECT_TRUE(decodes_content("\x02"s, 1, 1));
  EXPECT_FALSE(decodes_content("\x12"s, 1, 1));          // something beside an odd last nibble
  EXPECT_FALSE(decodes_content("\x12\x00"s, 2, 1));      // more than the nibbles ask for
  EXPECT_FALSE(decodes_content("\xf2"s, 2, 1));          // less
  EXPECT_FALSE(decodes_content("\xf2\xff\x0e"s, 2, 1));  // cut off
  EXPECT_TRUE(decodes_content("\xf2\xff\x0e\x01"s, 2, 1));
  EXPECT_FALSE(decodes_content("\xf2\xff\x0d\x01"s, 2, 1));  // 269 in three bytes
}

}  // namespace
}  // namespace dtact::wire
