#include "hal/files/png.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <stdexcept>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/hostile_files.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::image {
namespace {

TEST(Png, Grey16KeepsEveryBit) {
  const Grey16 image{3, 2, {0, 1, 255, 256, 65280, 65535}};
  const Grey16 back = decode_png_grey16(encode_png(image), "memory");
  EXPECT_EQ(back.width, 3);
  EXPECT_EQ(back.height, 2);
  EXPECT_EQ(back.pixels, image.pixels);
}

TEST(Png, Grey8IsWidened) {
  const Grey16 back = decode_png_grey16(encode_png(Grey8{2, 1, {0, 200}}), "memory");
  EXPECT_EQ(back.pixels, (std::vector<std::uint16_t>{0, 51400}));
}

TEST(Png, ColourBecomesBt601Luma) {
  // 0.299·255 = 76.2, 0.587·255 = 149.7, 0.114·255 = 29.1
  const Rgb8 image{4, 1, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}};
  const std::filesystem::path file = fakes::own_path(".png");
  base::write_file_atomically(file, encode_png(image));
  EXPECT_EQ(read_png_grey8(file).pixels, (std::vector<std::uint8_t>{76, 150, 29, 255}));
}

TEST(Png, DamagedFileIsNamed) {
  std::string bytes = encode_png(Grey8{64, 64, std::vector<std::uint8_t>(4096, 7)});
  for (const std::size_t keep :
       {std::size_t{0}, std::size_t{4}, std::size_t{20}, bytes.size() / 2}) {
    try {
      (void)decode_png_grey16(std::string_view(bytes).substr(0, keep), "broken.png");
      FAIL() << keep;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find("broken.png"), std::string::npos);
    }
  }
}

TEST(Png, TextsAndProfilesAreSkipped) {
  const Grey16 image{3, 2, {0, 1, 255, 256, 65280, 65535}};
  const std::string png = encode_png(image);
  // Each would be 7.9 MB.
  const std::string texts = fakes::with_text_chunks(png, 100, 7'900'000);
  const auto begin = std::clock();
  EXPECT_EQ(decode_png_grey16(texts, "memory").pixels, image.pixels);
  EXPECT_LT(std::clock() - begin, CLOCKS_PER_SEC / 2);
  // Longer than any chunk that is read, and broken inside.
  std::string content;
  content.resize(9'000'000, 'x');
  for (const char* type : {"tEXt", "iCCP", "zzZz"}) {
    std::string with = png;
    with.insert(33, fakes::png_chunk(type, content));
    EXPECT_EQ(decode_png_grey16(with, "memory").pixels, image.pixels) << type;
  }
}

TEST(Png, SizeAndKindAreKnownBeforePixels) {
  const std::string png = fakes::grey16_png(40, 30);
  const PngHeader header = png_header(std::string_view(png).substr(0, 26), "memory");
  EXPECT_EQ(header.width, 40);
  EXPECT_EQ(header.height, 30);
  EXPECT_EQ(header.bits, 16);
  EXPECT_TRUE(header.grey);
  const PngHeader colour = png_header(encode_png(Rgb8{1, 1, {1, 2, 3}}), "memory");
  EXPECT_EQ(colour.bits, 8);
  EXPECT_FALSE(colour.grey);
  EXPECT_THROW((void)png_header(std::string_view(png).substr(0, 25), "memory"), std::runtime_error);
}

TEST(Png, TooManyPixelsAreRefusedUnread) {
  for (const auto& [width, height] : {std::pair(16385U, 1U), std::pair(1U, 16385U),
                                      std::pair(16384U, 4097U), std::pair(0U, 5U)}) {
    // Only the header is there: what follows is not looked at.
    std::string png = fakes::grey16_png(1, 1).substr(0, 16);
    for (const std::uint32_t side : {width, height}) {
      for (unsigned i = 0; i < 4; ++i) png += static_cast<char>(side >> (24U - 8U * i));
    }
    png += "\x10";
    png += std::string(4, '\0');
    try {
      (void)decode_png_grey16(png, "large.png");
      FAIL() << width << "x" << height;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find(std::to_string(width) + "x" + std::to_string(height)),
                std::string::npos)
          << e.what();
    }
  }
}

}  // namespace
}  // namespace dtact::image
