#include "clients/calibrate/lens/pin_shift.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace dtact::ctl {
namespace {

using recon::Point;

constexpr std::size_t kRings = 20;  // of a fiftieth of the pitch
constexpr int kAngles = 48;

/// A pin's darkening by distance: mean, and first angular harmonic.
struct PinRings {
  Point from_foot;
  std::array<double, kRings> mean{};
  std::array<Point, kRings> harmonic{};
};

bool inside(const cv::Mat1f& image, Point px) {
  return px.x >= 0 && px.y >= 0 && px.x <= image.cols - 1 && px.y <= image.rows - 1;
}

/// False where the frame does not show all rings.
bool read_rings(const cv::Mat1f& darkening, const recon::Lens& lens, Point at, double step_mm,
                PinRings& out) {
  cv::Mat2f places(kRings, kAngles);
  for (int ring = 0; ring < places.rows; ++ring) {
    for (int i = 0; i < kAngles; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAngles;
      const double r = (ring + 1) * step_mm;
      const Point px = project(lens, {at.x + r * std::cos(angle), at.y + r * std::sin(angle)});
      if (!inside(darkening, px)) return false;
      places(ring, i) = cv::Vec2f(static_cast<float>(px.x), static_cast<float>(px.y));
    }
  }
  cv::Mat1f values;
  cv::remap(darkening, values, places, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (std::size_t ring = 0; ring < kRings; ++ring) {
    for (int i = 0; i < kAngles; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAngles;
      const double value = values(static_cast<int>(ring), i) / kAngles;
      out.mean[ring] += value;
      out.harmonic[ring].x += 2 * value * std::cos(angle);
      out.harmonic[ring].y += 2 * value * std::sin(angle);
    }
  }
  return true;
}

struct Slopes {
  double per_level = 0;
  double of_pins = 0;
};

/// Through the pins of these indices.
Slopes fit(std::span<const PinRings> pins, std::span<const std::size_t> chosen, double step_mm) {
  const auto count = static_cast<double>(chosen.size());
  std::array<double, kRings> level{};
  std::array<Point, kRings> harmonic{};
  Point middle;
  for (const std::size_t pin : chosen) {
    middle.x += pins[pin].from_foot.x / count;
    middle.y += pins[pin].from_foot.y / count;
    for (std::size_t ring = 0; ring < kRings; ++ring) {
      level[ring] += pins[pin].mean[ring] / count;
      harmonic[ring].x += pins[pin].harmonic[ring].x / count;
      harmonic[ring].y += pins[pin].harmonic[ring].y / count;
    }
  }
  // g · S′, S · S′² and S′² summed over the rings: two normal equations.
  double squares = 0;
  double cross = 0;
  double bends = 0;
  double right_level = 0;
  double right_pins = 0;
  double spread = 0;
  for (const std::size_t pin : chosen) {
    spread += std::pow(pins[pin].from_foot.x - middle.x, 2) +
              std::pow(pins[pin].from_foot.y - middle.y, 2);
  }
  for (std::size_t ring = 0; ring < kRings; ++ring) {
    double g = 0;
    for (const std::size_t pin : chosen) {
      g += (pins[pin].harmonic[ring].x - harmonic[ring].x) * (pins[pin].from_foot.x - middle.x) +
           (pins[pin].harmonic[ring].y - harmonic[ring].y) * (pins[pin].from_foot.y - middle.y);
    }
    g /= spread;
    const std::size_t before = ring == 0 ? 0 : ring - 1;
    const std::size_t after = ring + 1 == kRings ? ring : ring + 1;
    const double slope =
        (level[after] - level[before]) / (static_cast<double>(after - before) * step_mm);
    const double by_level = -level[ring] * slope;
    squares += by_level * by_level;
    cross += by_level * slope;
    bends += slope * slope;
    right_level += by_level * g;
    right_pins += slope * g;
  }
  const double determinant = squares * bends - cross * cross;
  return {(right_level * bends - cross * right_pins) / determinant,
          (squares * right_pins - cross * right_level) / determinant};
}

}  // namespace

std::string PinShift::describe() const {
  return fmt::format(
      "camera: points appear farther from its axis by {:.3f} ± {:.3f} % of their distance a grey "
      "level: {}",
      100 * per_level, 100 * error,
      sure() ? fmt::format("its height follows with a LUT; pins stand {:.2f} % farther out",
                           100 * of_pins)
             : "not sure, a height is assumed");
}

PinShift measure_pin_shift(const cv::Mat1f& reference, const cv::Mat1f& frame,
                           std::span<const Mark> marks, const recon::Lens& lens, double pitch_mm) {
  const cv::Mat1f darkening(reference - frame);
  const double step_mm = pitch_mm / 50;
  PinShift shift{.foot_mm = axis_foot(lens)};
  const std::vector<Point> off = residuals_mm(lens, marks);
  std::vector<PinRings> pins;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    // About the peak, not the nominal place: the difference would be noise.
    const Point at{marks[i].mm.x + off[i].x, marks[i].mm.y + off[i].y};
    PinRings rings{.from_foot = {at.x - shift.foot_mm.x, at.y - shift.foot_mm.y}};
    if (read_rings(darkening, lens, at, step_mm, rings)) pins.push_back(rings);
  }
  constexpr std::size_t kFewest = 12;
  if (pins.size() < kFewest) return shift;
  std::vector<std::size_t> chosen(pins.size());
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = i;
  const Slopes all = fit(pins, chosen, step_mm);
  shift.per_level = all.per_level;
  shift.of_pins = all.of_pins;
  constexpr int kDraws = 200;
  std::mt19937_64 random(1);
  double sum = 0;
  double squares = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    for (std::size_t& pin : chosen) pin = random() % pins.size();
    const double drawn = fit(pins, chosen, step_mm).per_level - all.per_level;
    sum += drawn;
    squares += drawn * drawn;
  }
  shift.error = std::sqrt(squares / kDraws - std::pow(sum / kDraws, 2));
  return shift;
}

recon::Lens undeformed(const recon::Lens& lens, const PinShift& shift) {
  // A place x of the undeformed surface appears where a pin at x − of_pins · (x − foot) does.
  recon::Lens out = lens;
  const double rest = 1 - shift.of_pins;
  for (std::size_t row = 0; row < 9; row += 3) {
    const auto& h = lens.homography;
    out.homography[row] = rest * h[row];
    out.homography[row + 1] = rest * h[row + 1];
    out.homography[row + 2] =
        h[row + 2] + shift.of_pins * (h[row] * shift.foot_mm.x + h[row + 1] * shift.foot_mm.y);
  }
  return out;
}

}  // namespace dtact::ctl
