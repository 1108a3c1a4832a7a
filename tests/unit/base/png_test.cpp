#include "hal/files/png.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "hal/base/atomic_file.hpp"
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

}  // namespace
}  // namespace dtact::image
