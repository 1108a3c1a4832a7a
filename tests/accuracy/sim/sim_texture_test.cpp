// The faint texture of the simulated gel against that of sensor_a: the common part of two
// references of one sensor, taken at different times, at three widths.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "hal/files/png.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/accuracy/sim/ball_profile.hpp"

namespace dtact::accuracy {
namespace {

namespace sim = hal::sim;

const std::filesystem::path kFolder = DTACT_SHARED_DIR "/data/sensor_a";

/// Subtracts its median from each row or column: a stripe of the camera's.
void remove_stripes(cv::Mat1f& image, bool columns) {
  cv::Mat1f sorted;
  if (columns) {
    cv::sort(image, sorted, cv::SORT_EVERY_COLUMN + cv::SORT_ASCENDING);
    cv::subtract(image, cv::repeat(sorted.row(image.rows / 2), image.rows, 1), image);
  } else {
    cv::sort(image, sorted, cv::SORT_EVERY_ROW + cv::SORT_ASCENDING);
    cv::subtract(image, cv::repeat(sorted.col(image.cols / 2), 1, image.cols), image);
  }
}

/// Detail between two widths (standard deviations, pixels), clipped so that a few specks do not
/// make the whole figure.
cv::Mat1f detail(const cv::Mat1f& image, double fine, double wide) {
  cv::Mat1f blurred;
  cv::Mat1f band;
  cv::GaussianBlur(image, blurred, {}, wide);
  cv::GaussianBlur(image, band, {}, fine);
  cv::subtract(band, blurred, band);
  band = band(cv::Rect(60, 40, image.cols - 120, image.rows - 80)).clone();
  remove_stripes(band, true);
  remove_stripes(band, false);
  cv::Mat1f sizes;
  cv::absdiff(band, 0, sizes);
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.total() / 2),
                   sizes.end());
  const float most =
      4 * 1.4826F * *(sizes.begin() + static_cast<std::ptrdiff_t>(sizes.total() / 2));
  for (float& value : band) value = std::clamp(value, -most, most);
  return band;
}

/// Standard deviation of the common part, grey levels.
double shared(const cv::Mat1f& a, const cv::Mat1f& b, double fine, double wide) {
  const double product = detail(a, fine, wide).dot(detail(b, fine, wide));
  return std::sqrt(std::max(0.0, product / static_cast<double>(a.total())));
}

cv::Mat1f real_reference(const char* name) {
  const image::Grey8 grey = image::read_png_grey8(kFolder / name);
  cv::Mat1f image(grey.height, grey.width);
  std::ranges::copy(grey.pixels, image.begin());
  return image;
}

cv::Mat1f simulated_reference() {
  const sim::Scene scene = sim::load_scene(std::filesystem::path(DTACT_SOURCE_DIR) /
                                           "tests/accuracy/sim" / "sensor_a.toml");
  sim::Renderer renderer(scene, 1);
  const auto clean = renderer.render_clean(0, sim::led_levels({}));
  cv::Mat1f image(scene.camera.height, scene.camera.width);
  std::ranges::transform(clean, image.begin(), [](std::uint16_t q6) { return q6 / 64.0F; });
  return image;
}

TEST(SimTexture, IsThatOfSensorA) {
  if (!std::filesystem::exists(kFolder)) {
    GTEST_SKIP() << "the real images of sensor_a are not at " << kFolder;
  }
  const cv::Mat1f first = real_reference("ball_reference.png");
  const cv::Mat1f second = real_reference("board_reference.png");
  const cv::Mat1f simulated = simulated_reference();
  for (const auto& [fine, wide] : {std::pair{1., 4.}, {1.5, 5.}, {2., 6.}}) {
    const double there = shared(first, second, fine, wide);
    const double here = shared(simulated, simulated, fine, wide);
    fmt::print("detail of {} to {} px: real {:.3f}, simulated {:.3f} grey levels\n", fine, wide,
               there, here);
    EXPECT_NEAR(here / there, 1, 0.25);
  }
}

}  // namespace
}  // namespace dtact::accuracy
