// All depth encodings compared on the golden vectors of tests/golden/depth and on arbitrary
// maps.
#include "proto/depth_encoding.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace dtact::wire {
namespace {

constexpr auto kEncodings = {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD};

std::string bytes_of(const std::string& hex) {
  std::string bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    bytes.push_back(static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// Decompressed content of a frame; the bytes of encodings without compression.
std::string content_of(v1::DepthEncoding encoding, const std::string& bytes) {
  if (encoding != v1::DEPTH_PREDICT_ZSTD) return bytes;
  std::string content(zstd_content_size(bytes).value_or(0), '?');
  EXPECT_TRUE(zstd_decompress(bytes, std::as_writable_bytes(std::span(content))));
  return content;
}

/// A file of tests/golden/depth; make.py there documents its lines.
struct Golden {
  std::string name;
  std::map<std::string, std::string> lines;

  [[nodiscard]] std::size_t width() const { return std::stoul(lines.at("width")); }
  [[nodiscard]] std::size_t height() const { return std::stoul(lines.at("height")); }
  [[nodiscard]] std::string sent(v1::DepthEncoding encoding) const {
    std::string key = v1::DepthEncoding_Name(encoding).substr(std::string("DEPTH_").size());
    std::ranges::transform(key, key.begin(), [](unsigned char c) { return std::tolower(c); });
    return bytes_of(lines.at(key));
  }
};

std::vector<Golden> read_golden() {
  std::vector<Golden> all;
  const auto folder = std::filesystem::path(DTACT_SOURCE_DIR) / "tests/golden/depth";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".txt") continue;
    Golden golden{entry.path().stem(), {}};
    std::ifstream file(entry.path());
    for (std::string key, value; file >> key >> value;) golden.lines[key] = value;
    all.push_back(golden);
  }
  return all;
}

TEST(DepthGolden, IsThere) { EXPECT_EQ(read_golden().size(), 10U); }

TEST(DepthGolden, DecodesToTheMap) {
  for (const Golden& golden : read_golden()) {
    std::vector<std::int16_t> map;
    ASSERT_TRUE(decode_int16(golden.sent(v1::DEPTH_INT16), golden.width(), golden.height(), map));
    for (const auto encoding : kEncodings) {
      std::vector<std::int16_t> decoded;
      EXPECT_TRUE(
          decode_depth(encoding, golden.sent(encoding), golden.width(), golden.height(), decoded))
          << golden.name << ' ' << encoding;
      EXPECT_EQ(decoded, map) << golden.name << ' ' << encoding;
    }
  }
}

TEST(DepthGolden, IsWhatIsEncoded) {
  DepthEncoder encoder;
  for (const Golden& golden : read_golden()) {
    std::vector<std::int16_t> map;
    ASSERT_TRUE(decode_int16(golden.sent(v1::DEPTH_INT16), golden.width(), golden.height(), map));
    for (const auto encoding : kEncodings) {
      std::string bytes;
      encoder.encode(encoding, map, golden.width(), bytes);
      EXPECT_EQ(content_of(encoding, bytes), content_of(encoding, golden.sent(encoding)))
          << golden.name << ' ' << encoding;
    }
  }
}

TEST(DepthEncoding, AllEncodingsAgreeOnArbitraryMaps) {
  std::mt19937 random(11);
  const auto below = [&](unsigned limit) { return static_cast<unsigned>(random() % limit); };
  DepthEncoder encoder;
  for (int round = 0; round < 400; ++round) {
    const std::size_t width = 1 + below(60);
    const std::size_t height = 1 + below(20);
    const unsigned zeros = below(11);  // tenths of the pixels
    const unsigned reach = 1U << below(17);
    std::vector<std::int16_t> map;
    for (std::size_t i = 0; i < width * height; ++i) {
      const auto value = static_cast<std::int16_t>(below(reach) - reach / 2);
      map.push_back(below(10) < zeros ? std::int16_t{0} : value);
    }
    for (const auto encoding : kEncodings) {
      std::string bytes;
      encoder.encode(encoding, map, width, bytes);
      std::vector<std::int16_t> back;
      ASSERT_TRUE(decode_depth(encoding, bytes, width, height, back)) << encoding;
      ASSERT_EQ(back, map) << encoding;
    }
  }
}

TEST(DepthEncoding, KnowsWhichThereAre) {
  EXPECT_FALSE(is_depth_encoding(v1::DEPTH_NONE));
  for (const auto encoding : kEncodings) EXPECT_TRUE(is_depth_encoding(encoding));
  EXPECT_FALSE(is_depth_encoding(static_cast<v1::DepthEncoding>(3)));
}

TEST(DepthEncoding, RefusesOthersAndPartsOfRows) {
  const std::vector<std::int16_t> map(6);
  DepthEncoder encoder;
  std::string bytes;
  EXPECT_THROW(encoder.encode(v1::DEPTH_NONE, map, 3, bytes), std::invalid_argument);
  EXPECT_THROW(encoder.encode(static_cast<v1::DepthEncoding>(3), map, 3, bytes),
               std::invalid_argument);
  for (const auto encoding : kEncodings) {
    EXPECT_THROW(encoder.encode(encoding, map, 4, bytes), std::invalid_argument);
  }
  std::vector<std::int16_t> back;
  EXPECT_FALSE(decode_depth(v1::DEPTH_NONE, "", 1, 1, back));
  EXPECT_FALSE(decode_depth(static_cast<v1::DepthEncoding>(3), "\1", 1, 1, back));
}

}  // namespace
}  // namespace dtact::wire
