#include "clients/ctl/depth_picture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "clients/common/exit_codes.hpp"
#include "clients/ctl/screen.hpp"

namespace dtact::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr int kUntrusted = -32768;

/// Depth in millimetres by column and row.
v1::Frame frame(int width, int height, const std::function<double(int, int)>& mm) {
  v1::Frame f;
  auto& map = *f.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(static_cast<std::uint32_t>(width));
  map.set_height(static_cast<std::uint32_t>(height));
  map.set_mm_per_px(0.1);
  map.set_um_per_unit(1);
  map.set_untrusted_value(kUntrusted);
  std::string data;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value = mm(x, y);
      const int units = std::isnan(value) ? kUntrusted : static_cast<int>(std::lround(value * 1e3));
      data += static_cast<char>(units & 0xff);
      data += static_cast<char>((units >> 8) & 0xff);
    }
  }
  map.set_data(data);
  return f;
}

/// Characters without the escapes for colours.
std::size_t columns_of(const std::string& line) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\x1b') {
      i = line.find('m', i);
    } else if ((static_cast<unsigned char>(line[i]) & 0xc0) != 0x80) {
      ++count;
    }
  }
  return count;
}

double lightness(Colour c) { return 0.30 * c.r + 0.59 * c.g + 0.11 * c.b; }

TEST(ColourOf, GrowsLighterAllTheWay) {
  for (int i = 1; i <= 100; ++i) {
    EXPECT_GT(lightness(cli::colour_of(i / 100.0)), lightness(cli::colour_of((i - 1) / 100.0)))
        << i;
  }
  EXPECT_LT(lightness(cli::colour_of(0)), 40);
  EXPECT_GT(lightness(cli::colour_of(1)), 220);
  EXPECT_EQ(cli::colour_of(-3), cli::colour_of(0));
  EXPECT_EQ(cli::colour_of(3), cli::colour_of(1));
}

TEST(FullScale, IsARoundNumber) {
  EXPECT_DOUBLE_EQ(cli::full_scale_mm(-1), 0.2);
  EXPECT_DOUBLE_EQ(cli::full_scale_mm(0.2), 0.2);
  EXPECT_DOUBLE_EQ(cli::full_scale_mm(0.21), 0.5);
  EXPECT_DOUBLE_EQ(cli::full_scale_mm(0.51), 1);
  EXPECT_DOUBLE_EQ(cli::full_scale_mm(1.4), 2);
}

TEST(Picture, FitsTheTerminal) {
  const v1::Frame square = frame(145, 145, [](int, int) { return 0.1; });
  for (const auto& [columns, rows] :
       {std::pair{80, 24}, {200, 20}, {kMinColumns, kMinRows}, {40, 100}}) {
    const auto lines = picture_of(square, 0.5, {columns, rows, Palette::rgb});
    EXPECT_LE(lines.size(), static_cast<std::size_t>(rows - 1));
    for (const auto& line : lines) {
      EXPECT_LE(columns_of(line), static_cast<std::size_t>(columns)) << columns << 'x' << rows;
    }
  }
  // The picture is as wide as high: a character is two pixels high.
  const auto lines = picture_of(square, 0.5, {80, 24, Palette::rgb});
  EXPECT_EQ(lines.size(), 23U);
  EXPECT_EQ(columns_of(lines[0]), 44U);
}

TEST(Picture, ShowsDepthByColour) {
  const v1::Frame half = frame(40, 40, [](int x, int) { return x < 20 ? 0.0 : 0.5; });
  const auto lines = picture_of(half, 0.5, {60, 22, Palette::rgb});
  ASSERT_EQ(lines.size(), 21U);
  const Colour low = cli::colour_of(0);
  const Colour high = cli::colour_of(1);
  const auto escapes = [](Colour c) {
    const std::string rgb =
        std::to_string(c.r) + ";" + std::to_string(c.g) + ";" + std::to_string(c.b) + "m";
    return "\x1b[38;2;" + rgb + "\x1b[48;2;" + rgb;
  };
  std::string expected = escapes(low);
  for (int i = 0; i < 20; ++i) expected += "\u2580";
  expected += escapes(high);
  for (int i = 0; i < 20; ++i) expected += "\u2580";
  EXPECT_EQ(lines[3], expected + "\x1b[0m");
  EXPECT_THAT(lines[20], AllOf(HasSubstr(" 0.5 mm deep"), HasSubstr("|---| 0.5 mm")));
}

TEST(Picture, ShowsUntrustedInGrey) {
  const auto lines =
      picture_of(frame(40, 40, [](int, int) { return std::nan(""); }), 0.5, {40, 22, Palette::rgb});
  EXPECT_THAT(lines[0], StartsWith("\x1b[38;2;96;96;96m\x1b[48;2;96;96;96m\u2580"));
}

TEST(Picture, MarksTheContact) {
  v1::Frame f = frame(40, 40, [](int, int) { return 0.0; });
  EXPECT_THAT(picture_of(f, 0.5, {40, 22, Palette::rgb})[10], Not(HasSubstr("+")));
  f.mutable_contact()->set_in_contact(true);
  f.mutable_contact()->set_x_mm(-1.0);  // ten columns left of the middle
  f.mutable_contact()->set_y_mm(0.45);  // four pixels below it
  const auto lines = picture_of(f, 0.5, {40, 22, Palette::rgb});
  EXPECT_EQ(columns_of(lines[12].substr(0, lines[12].find('+'))), 10U);
  EXPECT_THAT(lines[11], Not(HasSubstr("+")));
}

/// Where the cross is: characters before it, and its line.
std::pair<std::size_t, std::size_t> cross_of(int width, int height, double x_mm, double y_mm) {
  v1::Frame f = frame(width, height, [](int, int) { return 0.0; });
  f.mutable_contact()->set_in_contact(true);
  f.mutable_contact()->set_x_mm(x_mm);
  f.mutable_contact()->set_y_mm(y_mm);
  const auto lines = picture_of(f, 0.5, {50, 22, Palette::rgb});
  for (std::size_t line = 0; line < lines.size(); ++line) {
    const std::size_t cross = lines[line].find('+');
    if (cross != std::string::npos) return {columns_of(lines[line].substr(0, cross)), line};
  }
  return {0, 0};
}

// A character is a column and two rows of pixels. Before the middle, too, a place within a pixel is
// of that pixel.
TEST(Picture, MarksTheContactInItsOwnCharacter) {
  // 50 × 40 pixels of 0.1 mm: 12.3 columns and 4.5 rows before the middle are column 12, row 15.
  EXPECT_EQ(cross_of(50, 40, -1.23, -0.45), std::pair(12UL, 7UL));
  // 50 × 40 pixels of 0.2 mm: 5.5 columns and 1.5 rows behind it are column 30, row 21.
  EXPECT_EQ(cross_of(100, 80, 1.1, 0.3), std::pair(30UL, 10UL));
}

TEST(Picture, IsNeitherTurnedNorMirrored) {
  const v1::Frame corner =
      frame(50, 40, [](int x, int y) { return x >= 30 && y >= 12 ? 0.5 : 0.0; });
  const auto lines = picture_of(corner, 0.5, {50, 22, Palette::rgb});
  const Colour high = cli::colour_of(1);
  const std::string lit = "\x1b[38;2;" + std::to_string(high.r) + ";";
  EXPECT_EQ(columns_of(lines[6]), 50U);
  EXPECT_THAT(lines[5], Not(HasSubstr(lit))) << "rows 10 and 11";
  EXPECT_EQ(columns_of(lines[6].substr(0, lines[6].find(lit))), 30U) << "rows 12 and 13";
  EXPECT_THAT(lines[19], HasSubstr(lit)) << "the last rows";
}

std::string refusal_of(const char* term) {
  try {
    (void)palette_of(term, "truecolor");
  } catch (const cli::Failure& e) {
    return e.what();
  }
  return "none";
}

TEST(Picture, NamesTheTerminalThatHasNoColours) {
  for (const char* term : {"dumb", "vt100", "xterm-mono"}) {
    EXPECT_EQ(refusal_of(term),
              std::string("--draw needs a terminal with colours, and TERM is \"") + term +
                  "\": leave it out");
  }
  EXPECT_THAT(refusal_of(nullptr), HasSubstr("TERM is \"\""));
  EXPECT_EQ(refusal_of("vt220"), "none");
}

TEST(Picture, UsesTheColoursThatTheTerminalHas) {
  const v1::Frame f = frame(40, 40, [](int, int) { return 0.0; });
  EXPECT_THAT(picture_of(f, 0.5, {40, 22, Palette::xterm256})[0],
              AllOf(StartsWith("\x1b[38;5;"), Not(HasSubstr(";2;"))));
  EXPECT_EQ(palette_of("xterm-256color", "truecolor"), Palette::rgb);
  EXPECT_EQ(palette_of("xterm-256color", nullptr), Palette::xterm256);
  EXPECT_EQ(palette_of("screen", "24bit"), Palette::rgb);
  EXPECT_THROW((void)palette_of("dumb", "truecolor"), cli::Failure);
  EXPECT_THROW((void)palette_of(nullptr, nullptr), cli::Failure);
}

}  // namespace
}  // namespace dtact::ctl
