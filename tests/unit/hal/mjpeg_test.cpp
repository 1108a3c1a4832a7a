#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/malloc_counter.hpp"

namespace dtact::hal::mjpeg {
namespace {

using Bytes = std::vector<std::uint8_t>;
using fakes::make_jpeg;

int slope(int x, int y) { return 20 + 2 * x + y; }  // 20 … 193 on 64×48

class GreyDecoderTest : public ::testing::Test {
 protected:
  Status decode(std::span<const std::uint8_t> payload) {
    return decoder.decode(payload, out.data(), out.stride());
  }
  int worst_error() {
    int worst = 0;
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) {
        worst = std::max(worst, std::abs(int{out.row(y)[x]} - slope(x, y)));
      }
    }
    return worst;
  }
  GreyDecoder decoder{64, 48};
  luma::LumaBuffer out{64, 48};
};

TEST_F(GreyDecoderTest, FlatGreyIsExact) {
  const Bytes jpeg = make_jpeg({.quality = 100, .colour = false}, [](int, int) { return 200; });
  ASSERT_EQ(decode(jpeg), Status::ok);
  EXPECT_EQ(out.row(0)[0], 200);
  EXPECT_EQ(out.row(47)[63], 200);
}

TEST_F(GreyDecoderTest, ColourDoesNotReachTheLuma) {
  ASSERT_EQ(decode(make_jpeg({}, slope)), Status::ok);
  EXPECT_LE(worst_error(), 3);  // quality 95: quantisation steps of 1 to 2 in the low frequencies
}

TEST_F(GreyDecoderTest, StandardHuffmanTablesMayBeMissing) {
  ASSERT_EQ(decode(make_jpeg({.huffman_tables = false}, slope)), Status::ok);
  EXPECT_LE(worst_error(), 3);
}

TEST_F(GreyDecoderTest, RestartMarkersAreFollowed) {
  ASSERT_EQ(decode(make_jpeg({.restart_rows = 1}, slope)), Status::ok);
  EXPECT_LE(worst_error(), 3);
}

TEST_F(GreyDecoderTest, OddSizesAndStridesWork) {
  GreyDecoder odd(61, 45);
  luma::LumaBuffer wide(200, 45);
  ASSERT_EQ(odd.decode(make_jpeg({.width = 61, .height = 45}, slope), wide.data(), wide.stride()),
            Status::ok);
  EXPECT_NEAR(wide.row(44)[60], slope(60, 44), 3);
  EXPECT_EQ(wide.row(44)[61], 0);
}

TEST_F(GreyDecoderTest, DoubledMarkersAndTrailingBytesAreTolerated) {
  Bytes jpeg = make_jpeg({}, slope);
  jpeg.insert(jpeg.begin(), {0xFF, 0xD8});
  jpeg.insert(jpeg.end(), {0xFF, 0xD9, 0, 0, 0, 0});
  ASSERT_EQ(decode(jpeg), Status::ok);
  EXPECT_LE(worst_error(), 3);
}

TEST_F(GreyDecoderTest, NothingAndNonsenseAreReported) {
  EXPECT_EQ(decode({}), Status::empty);
  EXPECT_EQ(decode(Bytes(5000, 0x55)), Status::not_jpeg);
  EXPECT_EQ(decode(Bytes{0xFF}), Status::truncated);
  EXPECT_EQ(decode(Bytes{0xFF, 0xD8, 0xFF}), Status::truncated);
}

TEST_F(GreyDecoderTest, EveryTruncationIsReported) {
  const Bytes jpeg = make_jpeg({}, slope);
  for (std::size_t keep = 1; keep < jpeg.size(); ++keep) {
    ASSERT_EQ(decode(std::span(jpeg).first(keep)), Status::truncated) << keep;
  }
  EXPECT_EQ(decode(jpeg), Status::ok);  // and the decoder still works
}

TEST_F(GreyDecoderTest, TruncationHiddenByAnEndMarkerIsReported) {
  Bytes jpeg = make_jpeg({}, slope);
  jpeg.resize(jpeg.size() / 2 + 300);
  jpeg.insert(jpeg.end(), {0xFF, 0xD9});
  EXPECT_EQ(decode(jpeg), Status::corrupt);
}

TEST_F(GreyDecoderTest, StuffingBeforeTheEndMarkerIsToleratedUpTo16Bytes) {
  const auto stuffed = [](std::size_t bytes) {
    Bytes jpeg = make_jpeg({}, slope);
    jpeg.insert(jpeg.end() - 2, bytes, 0x55);
    return jpeg;
  };
  EXPECT_EQ(decode(stuffed(16)), Status::ok);
  EXPECT_LE(worst_error(), 3);
  // Up to eight of them are already in the decoder's 64 bits and are not counted.
  EXPECT_EQ(decode(stuffed(16 + 8 + 1)), Status::corrupt);
}

TEST_F(GreyDecoderTest, AnotherSizeIsReported) {
  EXPECT_EQ(decode(make_jpeg({.width = 48, .height = 64}, slope)), Status::wrong_size);
  Size size;
  ASSERT_EQ(decoder.read_size(make_jpeg({.width = 48, .height = 64}, slope), size), Status::ok);
  EXPECT_EQ(size, (Size{48, 64}));
}

TEST_F(GreyDecoderTest, ProgressiveIsUnsupported) {
  EXPECT_EQ(decode(make_jpeg({.progressive = true}, slope)), Status::unsupported);
  Size size;
  EXPECT_EQ(decoder.read_size(make_jpeg({.progressive = true}, slope), size), Status::unsupported);
  EXPECT_EQ(decode(make_jpeg({}, slope)), Status::ok);
}

TEST_F(GreyDecoderTest, FramesDoNotInheritTables) {
  ASSERT_EQ(decode(make_jpeg({}, slope)), Status::ok);
  Bytes jpeg = make_jpeg({}, slope);
  // A frame without its quantisation tables (marker FFDB becomes a comment, FFFE) is refused.
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xFF && jpeg[i + 1] == 0xDB) jpeg[i + 1] = 0xFE;
  }
  EXPECT_EQ(decode(jpeg), Status::corrupt);
}

TEST_F(GreyDecoderTest, FlippedBytesNeverCrashOrPoisonTheNextFrame) {
  const Bytes good = make_jpeg({.restart_rows = 1}, slope);
  std::minstd_rand random(7);
  for (int i = 0; i < 3000; ++i) {
    Bytes bad = good;
    for (int k = 0; k < 3; ++k) {
      bad[random() % bad.size()] = static_cast<std::uint8_t>(random() >> 8U);
    }
    (void)decode(bad);
  }
  ASSERT_EQ(decode(good), Status::ok);
  EXPECT_LE(worst_error(), 3);
}

TEST_F(GreyDecoderTest, ACropHoldsTheSameBitsWhereverItLies) {
  for (const bool colour : {false, true}) {
    const Bytes jpeg = make_jpeg({.quality = 60, .colour = colour},
                                 [](int x, int y) { return 128 + (x * 37 + y * 91) % 100 - 50; });
    luma::LumaBuffer whole(64, 48);
    ASSERT_EQ(decoder.decode(jpeg, whole.data(), whole.stride()), Status::ok);
    std::minstd_rand random(3);
    for (int i = 0; i < 300; ++i) {
      Area crop;
      crop.x = static_cast<int>(random() % 64);
      crop.y = static_cast<int>(random() % 48);
      crop.width = 1 + static_cast<int>(random() % static_cast<unsigned>(64 - crop.x));
      crop.height = 1 + static_cast<int>(random() % static_cast<unsigned>(48 - crop.y));
      GreyDecoder cropped(64, 48);
      cropped.set_crop(crop);
      luma::LumaBuffer part(80, 48);
      ASSERT_EQ(cropped.decode(jpeg, part.data(), part.stride()), Status::ok);
      for (int y = crop.y; y < crop.y + crop.height; ++y) {
        ASSERT_TRUE(std::equal(part.row(y) + crop.x, part.row(y) + crop.x + crop.width,
                               whole.row(y) + crop.x))
            << crop.x << "," << crop.y << " " << crop.width << "x" << crop.height << " row " << y;
      }
      for (int y = 0; y < 48; ++y) ASSERT_EQ(part.row(y)[64], 0) << "beside the picture";
    }
  }
}

TEST_F(GreyDecoderTest, AScaledPictureHoldsTheMeansOfThePixels) {
  for (const int scale : {2, 4}) {
    GreyDecoder scaled(64, 48, scale);
    luma::LumaBuffer picture(64 / scale, 48 / scale);
    ASSERT_EQ(scaled.decode(make_jpeg({}, slope), picture.data(), picture.stride()), Status::ok);
    for (int y = 0; y < 48 / scale; ++y) {
      for (int x = 0; x < 64 / scale; ++x) {
        // Of 2x + y: 2 and 1 times the distance from the corner pixel to the middle.
        const double mean = slope(x * scale, y * scale) + 1.5 * (scale - 1);
        EXPECT_NEAR(picture.row(y)[x], mean, 3) << scale << ": " << x << ", " << y;
      }
    }
  }
}

TEST_F(GreyDecoderTest, ACropOfAScaledPictureHoldsTheSameBits) {
  for (const int scale : {2, 4}) {
    for (const bool colour : {false, true}) {
      const Bytes jpeg = make_jpeg({.quality = 60, .colour = colour},
                                   [](int x, int y) { return 128 + (x * 37 + y * 91) % 100 - 50; });
      const int width = 64 / scale;
      const int height = 48 / scale;
      GreyDecoder scaled(64, 48, scale);
      luma::LumaBuffer whole(width, height);
      ASSERT_EQ(scaled.decode(jpeg, whole.data(), whole.stride()), Status::ok);
      std::minstd_rand random(3);
      for (int i = 0; i < 300; ++i) {
        Area crop;
        crop.x = static_cast<int>(random() % static_cast<unsigned>(width));
        crop.y = static_cast<int>(random() % static_cast<unsigned>(height));
        crop.width = 1 + static_cast<int>(random() % static_cast<unsigned>(width - crop.x));
        crop.height = 1 + static_cast<int>(random() % static_cast<unsigned>(height - crop.y));
        scaled.set_crop(crop);
        luma::LumaBuffer part(width + 16, height);
        ASSERT_EQ(scaled.decode(jpeg, part.data(), part.stride()), Status::ok);
        for (int y = crop.y; y < crop.y + crop.height; ++y) {
          ASSERT_TRUE(std::equal(part.row(y) + crop.x, part.row(y) + crop.x + crop.width,
                                 whole.row(y) + crop.x))
              << scale << ": " << crop.x << "," << crop.y << " " << crop.width << "x" << crop.height
              << " row " << y;
        }
        for (int y = 0; y < height; ++y) ASSERT_EQ(part.row(y)[width], 0) << "beside the picture";
      }
    }
  }
}

TEST(GreyDecoder, RefusesAScaleThatDoesNotDivideTheSize) {
  EXPECT_THROW(GreyDecoder(64, 48, 3), std::invalid_argument);
  EXPECT_THROW(GreyDecoder(62, 48, 4), std::invalid_argument);
  EXPECT_THROW(GreyDecoder(64, 46, 4), std::invalid_argument);
  EXPECT_NO_THROW(GreyDecoder(62, 46, 2));
}

TEST(GreyDecoder, SaysWhichFramesAreDecodedAtASmallerSize) {
  EXPECT_EQ(scale_error(1, "GREY"), "");
  EXPECT_EQ(scale_error(4, "MJPEG"), "");
  EXPECT_NE(scale_error(2, "YUYV").find("camera.decode_scale = 2: the frames are YUYV"),
            std::string::npos);
}

TEST_F(GreyDecoderTest, DamageBelowTheCropIsReported) {
  const Bytes jpeg = make_jpeg({}, slope);
  decoder.set_crop({16, 8, 16, 8});
  for (std::size_t keep = 1; keep < jpeg.size(); keep += 7) {
    ASSERT_EQ(decode(std::span(jpeg).first(keep)), Status::truncated) << keep;
  }
  EXPECT_EQ(decode(jpeg), Status::ok);
}

TEST_F(GreyDecoderTest, ACropOutsideThePictureMeansTheWholePicture) {
  const Bytes jpeg = make_jpeg({}, slope);
  ASSERT_EQ(decode(jpeg), Status::ok);
  const auto whole = std::vector(out.data(), out.data() + out.stride() * out.height());
  for (const Area crop :
       {Area{0, 0, 65, 1}, Area{60, 0, 5, 1}, Area{0, -1, 5, 5}, Area{0, 0, 0, 5}}) {
    std::fill_n(out.data(), out.stride() * out.height(), std::uint8_t{0});
    decoder.set_crop(crop);
    ASSERT_EQ(decode(jpeg), Status::ok);
    for (int y = 0; y < out.height(); ++y) {
      for (int x = 0; x < out.width(); ++x) {
        ASSERT_EQ(out.data()[y * out.stride() + x],
                  whole[static_cast<std::size_t>(y * out.stride() + x)]);
      }
    }
  }
}

TEST_F(GreyDecoderTest, MovesWithItsMemory) {
  GreyDecoder moved(std::move(decoder));
  EXPECT_EQ(moved.decode(make_jpeg({}, slope), out.data(), out.stride()), Status::ok);
}

TEST(GreyDecoder, RefusesSizesNoCameraHas) {
  EXPECT_THROW(GreyDecoder(0, 600), std::invalid_argument);
  EXPECT_THROW(GreyDecoder(800, 20000), std::invalid_argument);
}

TEST(GreyDecoder, NeverAllocatesWhileDecoding) {
  if (!fakes::can_count_allocations()) GTEST_SKIP() << "the sanitizer brings its own malloc";
  const Bytes good = make_jpeg({.width = 800, .height = 600},
                               [](int x, int y) { return 60 + (x * 7 + y * 13) % 120; });
  const Bytes bad(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(good.size() / 2));
  GreyDecoder decoder(800, 600);
  luma::LumaBuffer out(800, 600);
  const std::uint64_t before = fakes::counted_allocations();
  fakes::count_allocations(true);
  bool as_expected = true;
  for (int i = 0; i < 20; ++i) {
    as_expected = as_expected && decoder.decode(good, out.data(), out.stride()) == Status::ok &&
                  decoder.decode(bad, out.data(), out.stride()) == Status::truncated;
  }
  fakes::count_allocations(false);
  EXPECT_TRUE(as_expected);
  EXPECT_EQ(fakes::counted_allocations() - before, 0U);
  // The counter itself works (volatile: else the compiler drops the pair).
  fakes::count_allocations(true);
  int* volatile made = new int(1);
  delete made;
  fakes::count_allocations(false);
  EXPECT_GE(fakes::counted_allocations() - before, 1U);
}

}  // namespace
}  // namespace dtact::hal::mjpeg
