#include "daemon/recon/lens.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dtact::recon {
namespace {

constexpr int kWeights = 128;

struct Jacobian {
  double xx = 0;  ///< d column / d x, pixels per millimetre.
  double xy = 0;
  double yx = 0;
  double yy = 0;
};

Jacobian jacobian_at_origin(const Lens& lens) {
  constexpr double kStep = 1e-4;  // mm; the central difference's error is far below a nanometre
  const Point left = project(lens, {-kStep, 0});
  const Point right = project(lens, {kStep, 0});
  const Point above = project(lens, {0, -kStep});
  const Point below = project(lens, {0, kStep});
  return {(right.x - left.x) / (2 * kStep), (below.x - above.x) / (2 * kStep),
          (right.y - left.y) / (2 * kStep), (below.y - above.y) / (2 * kStep)};
}

/// Integer part and weight of a place, held between pixels 0 and size − 1.
struct Place {
  int whole = 0;
  int weight = 0;
};

Place split(double at, int size) {
  const long fine = std::lround(std::clamp<double>(at, 0, size - 1) * kWeights);
  // The last pixel is reached from the one before with the full weight.
  const long whole = std::min<long>(fine / kWeights, size - 2);
  return {static_cast<int>(whole), static_cast<int>(fine - whole * kWeights)};
}

/// A lower bound of the slope of ρ(1 + k₁ρ² + …) where ρ² is between two values.
double lowest_slope(const std::vector<double>& radial, double from_r2, double to_r2) {
  double slope = 1;
  double low = from_r2;
  double high = to_r2;
  double factor = 3;
  for (const double k : radial) {
    slope += factor * k * (k < 0 ? high : low);
    low *= from_r2;
    high *= to_r2;
    factor += 2;
  }
  return slope;
}

/// The bound is closer in parts of the way. True: the slope is positive everywhere from the centre
/// to `r2`. False: it may not be.
bool rises_in_parts(const std::vector<double>& radial, double r2) {
  constexpr int kParts = 8;
  for (int i = 0; i < kParts; ++i) {
    if (!(lowest_slope(radial, r2 * i / kParts, r2 * (i + 1) / kParts) > 0)) return false;
  }
  return true;
}

}  // namespace

Point project(const Lens& lens, Point mm) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto& h = lens.homography;
  const double w = h[6] * mm.x + h[7] * mm.y + h[8];
  if (!(w > 0)) return {kNan, kNan};
  const double x = (h[0] * mm.x + h[1] * mm.y + h[2]) / w - lens.centre_col;
  const double y = (h[3] * mm.x + h[4] * mm.y + h[5]) / w - lens.centre_row;
  const double r2 = (x * x + y * y) / (lens.radius_px * lens.radius_px);
  double stretch = 1;
  double power = r2;
  for (const double k : lens.radial) {
    stretch += k * power;
    power *= r2;
  }
  // The polynomial does not show points beyond a fold. Where a fold is possible, the
  // slope of ρ(1 + k₁ρ² + …) is checked all the way from the centre.
  constexpr int kSteps = 32;
  const bool may_fold = !(lowest_slope(lens.radial, 0, r2) > 0) && !rises_in_parts(lens.radial, r2);
  for (int i = 1; i <= kSteps && may_fold; ++i) {
    const double s2 = r2 * i * i / (kSteps * kSteps);
    double slope = 1;
    double s_power = s2;
    double odd = 3;
    for (const double k : lens.radial) {
      slope += odd * k * s_power;
      s_power *= s2;
      odd += 2;
    }
    if (!(slope > 0)) return {kNan, kNan};
  }
  return {lens.centre_col + x * stretch, lens.centre_row + y * stretch};
}

double central_mm_per_px(const Lens& lens) {
  const Jacobian j = jacobian_at_origin(lens);
  return 1 / std::sqrt(j.xx * j.yy - j.xy * j.yx);
}

Point axis_foot(const Lens& lens) {
  // Rows of the homography from the centre of distortion: q = A·x + t near the foot.
  std::array<double, 6> a{};
  for (std::size_t i = 0; i < 3; ++i) {
    a[i] = lens.homography[i] - lens.centre_col * lens.homography[6 + i];
    a[3 + i] = lens.homography[3 + i] - lens.centre_row * lens.homography[6 + i];
  }
  const double determinant = a[0] * a[4] - a[1] * a[3];
  return {(a[1] * a[5] - a[4] * a[2]) / determinant, (a[3] * a[2] - a[0] * a[5]) / determinant};
}

void check(const Lens& lens, int frame_width, int frame_height) {
  const Point origin = project(lens, {0, 0});
  if (!(origin.x >= 0 && origin.x <= frame_width - 1 && origin.y >= 0 &&
        origin.y <= frame_height - 1)) {
    throw std::invalid_argument("lens: the surface's origin does not lie in the frame");
  }
  const Jacobian j = jacobian_at_origin(lens);
  if (!(j.xx > 0 && j.yy > 0 && j.xx * j.yy - j.xy * j.yx > 0)) {
    throw std::invalid_argument("lens: the surface is mirrored or upside down");
  }
}

Point surface_point(const Lens& lens, const MapPlace& place, double x, double y) {
  const Point origin = project(lens, {0, 0});
  return {(place.col + x - origin.x) * place.mm_per_px,
          (place.row + y - origin.y) * place.mm_per_px};
}

Point map_pixel(const Lens& lens, const MapPlace& place, Point mm) {
  const Point corner = surface_point(lens, place, 0, 0);
  return {(mm.x - corner.x) / place.mm_per_px, (mm.y - corner.y) / place.mm_per_px};
}

RectifyTable make_lens_table(const Lens& lens, int frame_width, int frame_height,
                             const MapPlace& place, std::vector<std::uint8_t>& outside) {
  if (frame_width < 2 || frame_height < 2 || frame_width > INT16_MAX || frame_height > INT16_MAX) {
    throw std::invalid_argument("lens: the frame must be 2 to 32767 pixels wide and high");
  }
  if (place.width < 1 || place.height < 1 || !(place.mm_per_px > 0)) {
    throw std::invalid_argument("lens: the depth map is empty");
  }
  check(lens, frame_width, frame_height);
  RectifyTable table{frame_width, frame_height, place.width, place.height, {}};
  table.entries.reserve(static_cast<std::size_t>(place.width) *
                        static_cast<std::size_t>(place.height));
  outside.clear();
  const Point corner = surface_point(lens, place, 0, 0);
  for (int y = 0; y < place.height; ++y) {
    for (int x = 0; x < place.width; ++x) {
      const Point at =
          project(lens, {corner.x + x * place.mm_per_px, corner.y + y * place.mm_per_px});
      const bool seen =
          at.x >= 0 && at.x <= frame_width - 1 && at.y >= 0 && at.y <= frame_height - 1;
      outside.push_back(seen ? 0 : 1);
      if (std::isnan(at.x)) {
        // Any place does; its neighbour's keeps together what the kernel reads at once.
        table.entries.push_back(table.entries.empty() ? RectifyTable::Entry{}
                                                      : table.entries.back());
        continue;
      }
      const Place col = split(at.x, frame_width);
      const Place row = split(at.y, frame_height);
      table.entries.push_back(
          {static_cast<std::int16_t>(col.whole), static_cast<std::int16_t>(row.whole),
           static_cast<std::uint8_t>(col.weight), static_cast<std::uint8_t>(row.weight)});
    }
  }
  return table;
}

}  // namespace dtact::recon
