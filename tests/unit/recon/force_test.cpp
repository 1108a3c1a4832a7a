// The force law against the simulator's gel, which solves contact on a grid of its own.
#include "daemon/recon/force.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <vector>

#include "daemon/recon/model.hpp"
#include "hal/sim/elastic_layer.hpp"

namespace dtact::recon {
namespace {

constexpr int kWidth = 500;
constexpr int kHeight = 400;
constexpr double kMmPerPx = 0.0417;

// The solver's grid for the map.
constexpr int kGrid = 256;
constexpr double kSpacing = 0.125;

double place(double px, int size) { return (px - 0.5 * (size - 1)) * kMmPerPx; }

/// The map as a camera sees it through the gel: a Gaussian of 0.2 thicknesses along both axes.
cv::Mat1d blurred(const cv::Mat1d& map, double thickness_mm) {
  const double sigma = 0.2 * thickness_mm / kSpacing;
  const int reach = static_cast<int>(4 * sigma);
  cv::Mat1d out = map;
  for (int pass = 0; pass < 2; ++pass) {
    cv::Mat1d sum(kGrid, kGrid, 0.0);
    double total = 0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-k * k / (2 * sigma * sigma));
      total += weight;
      for (int i = 0; i < kGrid; ++i) {
        for (int j = 0; j < kGrid; ++j) sum(i, j) += weight * out(i, (j + k + kGrid) % kGrid);
      }
    }
    sum /= total;
    cv::Mat1d turned;
    cv::transpose(sum, turned);
    out = turned;
  }
  return out;
}

struct Contact {
  std::vector<std::int16_t> depth_um;
  double mm2 = 0;  ///< True force over the modulus.
};

/// `height_mm(x, y)` is the object's height above its lowest point.
template <typename Height>
Contact press(double thickness_mm, double depth_mm, Height height_mm) {
  const hal::sim::ElasticLayer layer(kGrid, kGrid, kSpacing, thickness_mm);
  cv::Mat1d target(kGrid, kGrid);
  constexpr int kMiddle = kGrid / 2;
  for (int i = 0; i < kGrid; ++i) {
    for (int j = 0; j < kGrid; ++j) {
      target(i, j) = depth_mm - height_mm((j - kMiddle) * kSpacing, (i - kMiddle) * kSpacing);
    }
  }
  const hal::sim::Pressed pressed = layer.solve(target, {});
  const cv::Mat1d seen = blurred(pressed.indentation_mm, thickness_mm);
  Contact contact;
  contact.mm2 = cv::sum(pressed.pressure)[0] * kSpacing * kSpacing;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto nearest = [](double mm) {
        return kGrid / 2 + static_cast<int>(std::lround(mm / kSpacing));
      };
      const double mm = seen(nearest(place(y, kHeight)), nearest(place(x, kWidth)));
      contact.depth_um.push_back(static_cast<std::int16_t>(std::lround(1000 * mm)));
    }
  }
  return contact;
}

double ball(double radius, double x, double y) {
  const double square = radius * radius - x * x - y * y;
  return square > 0 ? radius - std::sqrt(square) : 1e3;
}

/// A block of 5 × 3 mm, turned by 25 degrees.
double block(double x, double y) {
  const double turn = 25 * std::numbers::pi / 180;
  const double a = x * std::cos(turn) + y * std::sin(turn);
  const double b = y * std::cos(turn) - x * std::sin(turn);
  return std::abs(a) < 2.5 && std::abs(b) < 1.5 ? 0 : 1e3;
}

GelResponse::Answer answer_to(const Contact& contact, double thickness_mm) {
  CellMap cells(kWidth, kHeight, kMmPerPx);
  cells.read(contact.depth_um);
  GelResponse response(thickness_mm, cells);
  return response.answer(cells);
}

TEST(GelResponse, IsTheForceThatHoldsTheIndentation) {
  for (const double thickness : {1.5, 3.0}) {
    const Contact small =
        press(thickness, 0.4, [](double x, double y) { return ball(2, x - 2.3, y + 1.1); });
    EXPECT_NEAR(answer_to(small, thickness).mm2 / small.mm2, 1, 0.08) << thickness;
    const Contact large =
        press(thickness, 0.9, [](double x, double y) { return ball(8, x + 1.2, y - 0.4); });
    EXPECT_NEAR(answer_to(large, thickness).mm2 / large.mm2, 1, 0.08) << thickness;
    const Contact flat =
        press(thickness, 0.5, [](double x, double y) { return block(x - 1.7, y + 0.6); });
    EXPECT_NEAR(answer_to(flat, thickness).mm2 / flat.mm2, 1, 0.08) << thickness;
    const Contact two = press(thickness, 0.6, [](double x, double y) {
      return std::min(ball(3, x - 4.1, y + 1.3), ball(1.5, x + 3.9, y - 1.9));
    });
    EXPECT_NEAR(answer_to(two, thickness).mm2 / two.mm2, 1, 0.08) << thickness;
  }
}

TEST(GelResponse, IsLinearInTheDepthOfAFlatFace) {
  const auto flat = [](double x, double y) { return block(x - 1.7, y + 0.6); };
  const GelResponse::Answer shallow = answer_to(press(2, 0.3, flat), 2);
  const GelResponse::Answer deep = answer_to(press(2, 0.6, flat), 2);
  EXPECT_NEAR(deep.mm2 / shallow.mm2, 2, 0.1);
}

class ForceTest : public testing::Test {
 protected:
  static constexpr ForceModel kModel{.modulus_mpa = 0.2,
                                     .thickness_mm = 2,
                                     .zero_mm = 0.02,
                                     .error_share = 0,
                                     .pairs = 11,
                                     .from_n = 0.1,
                                     .to_n = 3};
  void fill(int x0, int y0, int width, int height, std::int16_t um) {
    for (int y = y0; y < y0 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) {
        map[static_cast<std::size_t>(y * kWidth + x)] = um;
      }
    }
  }
  ForceMeter::Reading read(double uncertainty_mm = 0.02) {
    const TileGrid grid(kWidth, kHeight);
    return meter.read(map, TileRows(static_cast<std::size_t>(grid.rows()), grid.all()),
                      uncertainty_mm);
  }
  std::vector<std::int16_t> map = std::vector<std::int16_t>(std::size_t{kWidth} * kHeight);
  ForceMeter meter{kModel, kWidth, kHeight, kMmPerPx};
};

TEST_F(ForceTest, IsTheModulusTimesTheAnswer) {
  fill(112, 80, 96, 64, 500);
  CellMap cells(kWidth, kHeight, kMmPerPx);
  cells.read(map);
  const GelResponse::Answer answer = GelResponse(2, cells).answer(cells);
  const ForceMeter::Reading said = read();
  ASSERT_TRUE(said.force);
  EXPECT_EQ(said.absence, ForceAbsence::none);
  EXPECT_NEAR(said.force->newtons, 0.2 * (answer.mm2 + 0.02 * answer.mm), 1e-9);
  EXPECT_EQ(meter.none().newtons, 0);
  EXPECT_NEAR(meter.none().uncertainty_n, 0.02, 1e-9);
}

TEST_F(ForceTest, IsLessSureOfUncertainMapsAndBeyondItsReadings) {
  const GelResponse::Answer answer{.mm2 = 10, .mm = 20};
  const Force sure = force_of(kModel, answer, 0.01);
  EXPECT_NEAR(sure.newtons, 2.08, 1e-9);
  EXPECT_GT(sure.uncertainty_n, 0.1);
  EXPECT_LT(sure.uncertainty_n, 0.15);
  EXPECT_GT(force_of(kModel, answer, 0.5).uncertainty_n, 0.4);
  ForceModel light = kModel;
  light.to_n = 0.5;
  EXPECT_GT(force_of(light, answer, 0.01).uncertainty_n, sure.uncertainty_n + 0.05);
  EXPECT_EQ(force_of(kModel, {.mm2 = -1, .mm = 0}, 0.01).newtons, 0) << "nothing pulls";
}

TEST_F(ForceTest, IsNotKnownWhereTheContactIsCutOff) {
  fill(0, 80, 96, 64, 500);
  EXPECT_EQ(read().absence, ForceAbsence::cut_off);
  EXPECT_FALSE(read().force);
  fill(0, 80, 96, 64, 0);
  fill(112, 80, 96, 64, 500);
  EXPECT_TRUE(read().force);
  map[std::size_t{88} * kWidth + 130] = kUntrusted;  // one of 256 in its cell
  EXPECT_TRUE(read().force);
  fill(208, 80, 32, 64, kUntrusted);
  EXPECT_EQ(read().absence, ForceAbsence::cut_off);
}

// 507 × 411 pixels are 31 × 25 cells of 16, and 11 columns and rows. Before: a contact that covered
// those alone had a force of 0.
TEST(CellMap, AContactIsCutOffByEachEdgeOfAnyMap) {
  constexpr int kColumns = 507;
  constexpr int kRows = 411;
  const auto cut_off = [](int x, int y, int width, int height) {
    std::vector<std::int16_t> map(std::size_t{kColumns} * kRows);
    for (int row = y; row < y + height; ++row) {
      for (int column = x; column < x + width; ++column) {
        map[static_cast<std::size_t>(row * kColumns + column)] = 300;
      }
    }
    CellMap cells(kColumns, kRows, kMmPerPx);
    cells.read(map);
    return cells.cut_off();
  };
  EXPECT_TRUE(cut_off(0, 160, 10, 64)) << "left";
  EXPECT_TRUE(cut_off(160, 0, 64, 10)) << "top";
  EXPECT_TRUE(cut_off(kColumns - 10, 160, 10, 64)) << "right";
  EXPECT_TRUE(cut_off(160, kRows - 10, 64, 10)) << "bottom";
  EXPECT_TRUE(cut_off(kColumns - 10, kRows - 10, 10, 10)) << "corner";
  EXPECT_FALSE(cut_off(160, 160, 64, 64));
  EXPECT_FALSE(cut_off(kColumns - 2, 160, 2, 8)) << "noise";
}

// 480 × 400 pixels are 30 × 25 cells and nothing beside them.
TEST(CellMap, AContactInTheLastCellsIsCutOff) {
  const auto cut_off = [](int x, int y, int width, int height) {
    std::vector<std::int16_t> map(std::size_t{480} * kHeight);
    for (int row = y; row < y + height; ++row) {
      std::fill_n(map.begin() + row * 480 + x, width, std::int16_t{300});
    }
    CellMap cells(480, kHeight, kMmPerPx);
    cells.read(map);
    return cells.cut_off();
  };
  EXPECT_TRUE(cut_off(464, 160, 16, 64)) << "right";
  EXPECT_FALSE(cut_off(448, 160, 16, 64)) << "one cell before it";
  EXPECT_TRUE(cut_off(160, 384, 64, 16)) << "bottom";
  EXPECT_FALSE(cut_off(160, 368, 64, 16)) << "one cell before it";
  EXPECT_TRUE(cut_off(0, 160, 16, 64)) << "left";
  EXPECT_FALSE(cut_off(16, 160, 16, 64)) << "one cell before it";
  EXPECT_TRUE(cut_off(160, 0, 64, 16)) << "top";
  EXPECT_FALSE(cut_off(160, 16, 64, 16)) << "one cell before it";
}

TEST_F(ForceTest, IsNotKnownBesideWhatIsUntrustedOnAnySide) {
  const auto absence_beside = [this](int x, int y, int width, int height) {
    fill(0, 0, kWidth, kHeight, 0);
    fill(160, 160, 64, 48, 500);
    fill(x, y, width, height, kUntrusted);
    return read().absence;
  };
  EXPECT_EQ(absence_beside(144, 160, 16, 16), ForceAbsence::cut_off) << "left";
  EXPECT_EQ(absence_beside(224, 192, 16, 16), ForceAbsence::cut_off) << "right";
  EXPECT_EQ(absence_beside(160, 144, 16, 16), ForceAbsence::cut_off) << "above";
  EXPECT_EQ(absence_beside(208, 208, 16, 16), ForceAbsence::cut_off) << "below";
  EXPECT_EQ(absence_beside(144, 144, 16, 16), ForceAbsence::none) << "a corner is no neighbour";
  EXPECT_EQ(absence_beside(128, 160, 16, 48), ForceAbsence::none) << "a cell between them";
}

TEST_F(ForceTest, LooksWhereTheMapIsNotZeroAlone) {
  fill(112, 80, 96, 64, 500);
  const double all = read().force->newtons;
  const TileGrid grid(kWidth, kHeight);
  TileRows tiles(static_cast<std::size_t>(grid.rows()));
  for (std::size_t row = 5; row < 9; ++row) tiles[row] = 0x7FU;  // columns 0 to 223
  EXPECT_EQ(meter.read(map, tiles, 0.02).force->newtons, all);
}

}  // namespace
}  // namespace dtact::recon
