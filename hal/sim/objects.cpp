#include "hal/sim/objects.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "hal/files/png.hpp"

namespace dtact::hal::sim {
namespace {

constexpr double kTan30 = 0.57735026919;
constexpr double kCos30 = 0.86602540378;

// How far (x, y) lies from the centre of a regular hexagon across its flats: half the width across
// flats on the outline. Two corners lie on the x axis.
double across_flats(double x, double y) {
  return std::max(std::abs(y), kCos30 * std::abs(x) + std::abs(y) / 2);
}

// The round top of something of `radius` lying or standing on its lowest point, `r` beside it.
double round_top(double radius, double r) {
  return r < radius ? radius - std::sqrt(radius * radius - r * r) : kNoSurface;
}

// A threaded rod on its side along x, its axis at y = 0.
double threaded_rod(double x, double y, double diameter, double pitch, double length) {
  const double radius = diameter / 2;
  if (std::abs(x) > length / 2 || std::abs(y) >= radius) return kNoSurface;
  // ISO 68-1 profile: 60° flanks, crests P/8 wide, cut 0.6134 P deep on an external thread.
  const double turns = x / pitch + std::asin(y / radius) / (2 * std::numbers::pi);
  const double from_crest = std::abs(turns - std::round(turns)) * pitch;
  const double cut = std::clamp((from_crest - pitch / 16) / kTan30, 0.0, 0.6134 * pitch);
  const double r = radius - cut;
  return std::abs(y) < r ? radius - std::sqrt(r * r - y * y) : kNoSurface;
}

// The same on its upper side: `radius` is where it is widest.
Object round_all_over(Object object, double radius) {
  object.top_mm = [radius, height = object.height_mm](double x, double y) {
    return 2 * radius - height(x, y);
  };
  return object;
}

}  // namespace

Object ball(double radius) {
  return round_all_over(
      {"ball", radius, [=](double x, double y) { return round_top(radius, std::hypot(x, y)); }},
      radius);
}

Object ball_array(double radius, double pitch, int rows, int columns) {
  const double right = (columns - 1) * pitch / 2;
  const double bottom = (rows - 1) * pitch / 2;
  const auto height = [=](double x, double y) {
    const double nx =
        std::clamp(std::round((x + right) / pitch), 0.0, static_cast<double>(columns - 1));
    const double ny =
        std::clamp(std::round((y + bottom) / pitch), 0.0, static_cast<double>(rows - 1));
    return round_top(radius, std::hypot(x + right - nx * pitch, y + bottom - ny * pitch));
  };
  return round_all_over({"ball_array", std::hypot(right, bottom) + radius, height}, radius);
}

Object disc(double radius) {
  return {"disc", radius,
          [=](double x, double y) { return std::hypot(x, y) <= radius ? 0 : kNoSurface; }};
}

Object two_pillars(double radius, double spacing) {
  return {"two_pillars", spacing / 2 + radius, [=](double x, double y) {
            return std::hypot(std::abs(x) - spacing / 2, y) <= radius ? 0 : kNoSurface;
          }};
}

Object cube(double side) {
  return {"cube", side * std::numbers::sqrt2 / 2, [=](double x, double y) {
            return std::max(std::abs(x), std::abs(y)) <= side / 2 ? 0 : kNoSurface;
          }};
}

Object cylinder(double radius, double length) {
  const auto height = [=](double x, double y) {
    return std::abs(x) <= length / 2 ? round_top(radius, std::abs(y)) : kNoSurface;
  };
  return round_all_over({"cylinder", std::hypot(radius, length / 2), height}, radius);
}

Object grating(double pitch, double groove_depth, double side) {
  return {"grating", side * std::numbers::sqrt2 / 2, [=](double x, double y) {
            if (std::max(std::abs(x), std::abs(y)) > side / 2) return kNoSurface;
            const double phase = x / pitch - std::floor(x / pitch);
            return phase < 0.25 || phase >= 0.75 ? 0 : groove_depth;  // a ridge at the centre
          }};
}

// 7 rows × 9 columns, pitch 2.5 mm, each pin a cylinder of radius 0.6 mm with a hemispherical tip,
// 1.5 mm tall in all: the calibration board of the 9DTact family.
Object pin_board() {
  constexpr double kPitch = 2.5;
  constexpr double kRadius = 0.6;
  constexpr double kTall = 1.5;
  const Object tips = ball_array(kRadius, kPitch, 7, 9);
  return {"pin_board", tips.reach_mm + 1, [=](double x, double y) {
            const bool plate = std::abs(x) <= 4 * kPitch + 1 && std::abs(y) <= 3 * kPitch + 1;
            return std::min(tips.height_mm(x, y), plate ? kTall : kNoSurface);
          }};
}

// ISO 4032 M4: 7.0 mm across flats, bearing face 5.9 mm (dw, min.), 30° chamfer; the thread's
// countersink opens to 4.3 mm (da 4.0…4.6) at 120°; minor diameter 3.242 mm (ISO 724).
Object m4_nut() {
  constexpr double kFlats = 7.0;
  constexpr double kFace = 5.9;
  constexpr double kSink = 4.3;
  constexpr double kBore = 3.242;
  return {"m4_nut", kFlats / kCos30 / 2, [](double x, double y) {
            const double r = std::hypot(x, y);
            if (across_flats(x, y) > kFlats / 2 || r < kBore / 2) return kNoSurface;
            if (r < kSink / 2) return (kSink / 2 - r) * kTan30;
            return std::max(r - kFace / 2, 0.0) * kTan30;
          }};
}

// DIN 6334 M3: 5.5 mm across flats, 9 mm long (3 d). On one flat, along x.
Object m3_long_nut() {
  constexpr double kFlats = 5.5;
  constexpr double kLength = 9.0;
  constexpr double kHalfFlat = kFlats / 2 * kTan30;
  return {"m3_long_nut", std::hypot(kLength / 2, 2 * kHalfFlat), [](double x, double y) {
            if (std::abs(x) > kLength / 2 || std::abs(y) > 2 * kHalfFlat) return kNoSurface;
            return std::max(std::abs(y) - kHalfFlat, 0.0) / kTan30;  // the next flats, at 60°
          }};
}

// ISO 4017 M5, on its head: 8.0 mm across flats; the top is chamfered at 30° outside a circle of
// 0.95 times that.
Object m5_hexagon_screw() {
  constexpr double kFlats = 8.0;
  return {"m5_hexagon_screw", kFlats / kCos30 / 2, [](double x, double y) {
            if (across_flats(x, y) > kFlats / 2) return kNoSurface;
            return std::max(std::hypot(x, y) - 0.95 * kFlats / 2, 0.0) * kTan30;
          }};
}

// ISO 4026 set screws M3 × 6, M4 × 8 and M5 × 10 side by side on their threads; pitches 0.5, 0.7
// and 0.8 mm (ISO 261).
Object three_set_screws() {
  struct Screw {
    double y, diameter, pitch, length;
  };
  static constexpr std::array<Screw, 3> kScrews = {
      {{-5.5, 3, 0.5, 6}, {0, 4, 0.7, 8}, {6, 5, 0.8, 10}}};
  return {"three_set_screws", std::hypot(8.5, 5.0), [](double x, double y) {
            double height = kNoSurface;
            for (const Screw& s : kScrews) {
              height = std::min(height, threaded_rod(x, y - s.y, s.diameter, s.pitch, s.length));
            }
            return height;
          }};
}

// A flat five-pointed star, its inner corners at 0.382 of the outer ones: the pentagram's ratio.
Object star(double outer_radius) {
  return {"star", outer_radius, [=](double x, double y) {
            constexpr double kTenth = std::numbers::pi / 5;
            constexpr double kInner = 0.381966;
            // Fold the angle into the tenth between an outer corner and its inner neighbour.
            double angle = std::abs(std::atan2(x, -y));
            angle = std::fmod(angle, 2 * kTenth);
            if (angle > kTenth) angle = 2 * kTenth - angle;
            const double r = std::hypot(x, y);
            // Inside of the edge from (outer, 0) to inner·(cos, sin)(36°).
            const double ex = kInner * std::cos(kTenth) - 1;
            const double ey = kInner * std::sin(kTenth);
            const double px = r * std::cos(angle) / outer_radius - 1;
            const double py = r * std::sin(angle) / outer_radius;
            return ex * py - ey * px >= 0 ? 0 : kNoSurface;
          }};
}

// A ribbed cap on its open rim. The opening clears the 13 mm thread of a GPI/SPI 13-425 neck; no
// standard fixes the outside: a wall of 1.2 mm and 36 ribs of 0.3 mm are this drawing's.
Object screw_cap() {
  constexpr double kOpening = 13.2;
  constexpr double kWall = 1.2;
  constexpr double kRib = 0.3;
  constexpr double kOutside = kOpening / 2 + kWall;
  return {"screw_cap", kOutside + kRib, [](double x, double y) {
            const double r = std::hypot(x, y);
            const double rib = std::cos(36 * std::atan2(y, x)) > 0 ? kRib : 0;
            return r >= kOpening / 2 && r <= kOutside + rib ? 0 : kNoSurface;
          }};
}

// USB Type-C Cable and Connector Specification, plug: shell 8.25 × 2.40 mm with round ends, 6.65 mm
// long. On its flat side, plugging along x.
Object usb_c_plug() {
  constexpr double kWidth = 8.25;
  constexpr double kThick = 2.40;
  constexpr double kLength = 6.65;
  return {"usb_c_plug", std::hypot(kLength / 2, kWidth / 2), [](double x, double y) {
            if (std::abs(x) > kLength / 2) return kNoSurface;
            return round_top(kThick / 2, std::max(std::abs(y) - (kWidth - kThick) / 2, 0.0));
          }};
}

// A flat cylinder-lock key; no standard: a bow of 9 mm radius would not fit, so 5 mm with a 3 mm
// hole, a blade 6.5 × 14 mm with five 90° bits and a milled groove 1.2 mm wide and 0.6 mm deep.
Object key() {
  return {"key", 13.0, [](double x, double y) {
            const double bow = std::hypot(x + 7, y);
            if (bow <= 5) return bow < 1.5 ? kNoSurface : 0;
            if (x < -7 || x > 12 || std::abs(y) > 3.25) return kNoSurface;
            constexpr std::array<double, 5> kBits = {0.9, 1.5, 0.6, 1.8, 1.2};
            for (std::size_t i = 0; i < kBits.size(); ++i) {
              const double along = std::abs(x - (0.5 + 2.2 * static_cast<double>(i)));
              if (y < -3.25 + kBits[i] - std::max(along - 0.4, 0.0)) return kNoSurface;
            }
            return std::abs(y - 1.4) < 0.6 ? 0.6 : 0;
          }};
}

Object height_map(const std::filesystem::path& png, double mm_per_px, double relief) {
  const auto image = std::make_shared<const image::Grey16>(image::read_png_grey16(png));
  const std::uint16_t nearest = *std::max_element(image->pixels.begin(), image->pixels.end());
  const double half_w = (image->width - 1) / 2.0;
  const double half_h = (image->height - 1) / 2.0;
  return {"height_map", std::hypot(half_w, half_h) * mm_per_px, [=](double x, double y) {
            const double column = x / mm_per_px + half_w;
            const double row = y / mm_per_px + half_h;
            if (column < 0 || row < 0 || column > image->width - 1 || row > image->height - 1) {
              return kNoSurface;
            }
            const int c0 = std::min(static_cast<int>(column), std::max(image->width - 2, 0));
            const int r0 = std::min(static_cast<int>(row), std::max(image->height - 2, 0));
            const auto at = [&](int r, int c) {
              const auto i = static_cast<std::size_t>(std::min(r, image->height - 1)) *
                                 static_cast<std::size_t>(image->width) +
                             static_cast<std::size_t>(std::min(c, image->width - 1));
              return static_cast<double>(image->pixels[i]);
            };
            const double top = std::lerp(at(r0, c0), at(r0, c0 + 1), column - c0);
            const double bottom = std::lerp(at(r0 + 1, c0), at(r0 + 1, c0 + 1), column - c0);
            return (nearest - std::lerp(top, bottom, row - r0)) / 65535 * relief;
          }};
}

}  // namespace dtact::hal::sim
