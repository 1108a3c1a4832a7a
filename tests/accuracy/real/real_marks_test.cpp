// Whether a moved camera shows in the faint marks of real gels. Two references of one sensor,
// taken at different times, are still; then the gel's detail in one of them is moved, but its
// stripes and the noise's place in the frame are not.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/pipeline/reference/gel_marks.hpp"
#include "tests/accuracy/real/press_images.hpp"

namespace dtact {
namespace {

using pipeline::GelMarks;

GelMarks marks_of(const cv::Mat1f& image) {
  std::vector<std::uint16_t> q8;
  q8.reserve(image.total());
  for (const float grey : image) q8.push_back(static_cast<std::uint16_t>(std::lround(256 * grey)));
  return {q8, image.cols, {60, 40, image.cols - 120, image.rows - 80}};
}

/// Moves the fine detail `x` to the right and `y` down; smooth light and vertical stripes stay.
cv::Mat1f with_gel_moved(const cv::Mat1f& image, double x, double y) {
  cv::Mat1f smooth;
  cv::Mat1f gel;
  cv::GaussianBlur(image, smooth, {}, 8);
  cv::subtract(image, smooth, gel);
  cv::Mat1f sorted;
  cv::sort(gel, sorted, cv::SORT_EVERY_COLUMN + cv::SORT_ASCENDING);
  const cv::Mat1f stripes = cv::repeat(sorted.row(gel.rows / 2), gel.rows, 1);
  cv::subtract(gel, stripes, gel);
  const cv::Mat1d move = (cv::Mat1d(2, 3) << 1, 0, x, 0, 1, y);
  cv::Mat1f moved;
  cv::warpAffine(gel, moved, move, gel.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  cv::add(moved, smooth, moved);
  cv::add(moved, stripes, moved);
  cv::max(moved, 0, moved);
  return moved;
}

/// The sensor's folder, and which of its two references comes first.
class RealMarks : public testing::TestWithParam<std::tuple<const char*, const char*, const char*>> {
};

TEST_P(RealMarks, AStillSensorsDoNotMoveAndAMovedOnesDo) {
  const auto& [sensor, first, second] = GetParam();
  const auto folder = sensor_folder(sensor);
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const cv::Mat1f image = load_pair(*folder, second).reference;
  const GelMarks then = marks_of(load_pair(*folder, first).reference);
  if (const auto still = then.moved_to(marks_of(image))) {
    ADD_FAILURE() << fmt::format("still, but moved by {}, {}: {:.1f}", still->x, still->y,
                                 still->strength);
  }
  // Temperature alone moves it by half a pixel.
  EXPECT_FALSE(then.moved_to(marks_of(with_gel_moved(image, 0.4, 0.3))));
  for (const auto& [x, y] : {std::pair{2, 1}, {3, -2}, {-5, 4}, {0, 12}}) {
    const auto move =
        then.moved_to(marks_of(with_gel_moved(image, x, y))).value_or(GelMarks::Move{});
    EXPECT_GT(move.strength, GelMarks::kSure) << x << ", " << y;
    EXPECT_NEAR(move.x, x, 1.5);
    EXPECT_NEAR(move.y, y, 1.5);
    fmt::print("{}, {} first, moved by {}, {}: stands out by {:.1f}\n", sensor, first, x, y,
               move.strength);
  }
}

INSTANTIATE_TEST_SUITE_P(Sensors, RealMarks,
                         testing::Values(std::tuple{"sensor_a", "ball", "board"},
                                         std::tuple{"sensor_a", "board", "ball"},
                                         std::tuple{"sensor_b", "ball", "board"},
                                         std::tuple{"sensor_b", "board", "ball"}));

}  // namespace
}  // namespace dtact
