#include "tests/recognition/objects.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/recognition/outlines.hpp"

namespace dtact::recognition {
namespace {

namespace sim = hal::sim;
using sim::kNoSurface;
using sim::Object;
using whole::Draw;

constexpr double kTan30 = 0.57735026919;
constexpr double kCos30 = 0.86602540378;

double hexagon(double x, double y, double half_flats) {
  return std::max(std::abs(y), kCos30 * std::abs(x) + std::abs(y) / 2) - half_flats;
}
/// A hexagonal bar, `across` from its middle line, on a flat or on an edge.
double hexagonal_bar(double across, double flats, bool on_edge) {
  const double side = flats * kTan30;
  if (on_edge) return across < flats / 2 ? across * kTan30 : kNoSurface;
  return across < side ? std::max(0.0, across - side / 2) / kTan30 : kNoSurface;
}

Object cylinder(Draw& d, Draw& press) {
  const double radius = d.uniform(1.2, 6);
  const double length = d.uniform(5, 35);
  const double chamfer = d.uniform(0, 0.5);
  if (press.chance(0.2)) {
    return object([=](double x, double y) { return face(circle(x, y, radius), chamfer); });
  }
  return object([=](double x, double y) {
    const double end = std::abs(x) - length / 2;
    return end > 0 ? kNoSurface : round_top(radius, std::abs(y)) + std::max(0.0, chamfer + end);
  });
}

Object nut(Draw& d, Draw& press) {
  const double thread = d.uniform(3, 10);
  const double flats = d.uniform(1.5, 1.8) * thread;
  const double high = d.uniform(0.75, 1.1) * thread;
  const double rim = d.uniform(0.9, 0.98) * flats / 2;
  const double bore = 0.83 * thread / 2;
  const double sink = d.uniform(1.0, 1.3) * bore;
  if (press.chance(0.2)) {
    return object([=](double x, double y) {
      return std::abs(x) > high / 2 ? kNoSurface : hexagonal_bar(std::abs(y), flats, false);
    });
  }
  return object([=](double x, double y) {
    const double r = std::hypot(x, y);
    if (hexagon(x, y, flats / 2) > 0 || r < bore) return kNoSurface;
    return std::max({0.0, (r - rim) * kTan30, (sink - r) * kTan30});
  });
}

Object bolt(Draw& d, Draw& press) {
  const double thread = d.uniform(4, 10);
  const double pitch = d.uniform(0.13, 0.19) * thread;
  const double length = d.uniform(8, 25);
  const double shank = d.chance(0.4) ? d.uniform(0.2, 0.5) * length : 0;
  const double flats = d.uniform(1.5, 1.75) * thread;
  const double head = d.uniform(0.6, 1) * thread;
  const bool socket = d.chance(0.4);  // a round head with a hexagonal hole
  const double rim = d.uniform(0.9, 0.98) * flats / 2;
  if (press.chance(0.35)) {
    return object([=](double x, double y) {
      const double r = std::hypot(x, y);
      if (socket && (r > flats / 2 || hexagon(x, y, 0.4 * thread) < 0)) return kNoSurface;
      if (!socket && hexagon(x, y, flats / 2) > 0) return kNoSurface;
      return std::max(0.0, (r - rim) * (socket ? 1 : kTan30));
    });
  }
  // Lies on the head's rim and the thread's end.
  const double lean = (flats - thread) / 2 / length;
  const double from = press.uniform(0.1, 0.9) * length;
  return object([=](double x, double y) {
    const double along = x + from;
    const double v = std::abs(y);
    if (along < -head || along > length) return kNoSurface;
    double height = kNoSurface;
    if (along < 0) {
      height = socket ? round_top(flats / 2, v) : hexagonal_bar(v, flats, false);
    } else if (v < thread / 2) {
      double radius = thread / 2;
      if (along > shank) {  // ISO 68-1: 60° flanks, crests P/8 wide, cut 0.6134 P deep
        const double turns = along / pitch + std::asin(y / radius) / (2 * kPi);
        const double from_crest = std::abs(turns - std::round(turns)) * pitch;
        radius -= std::clamp((from_crest - pitch / 16) / kTan30, 0.0, 0.6134 * pitch);
      }
      height = v < radius ? flats / 2 - std::sqrt(radius * radius - v * v) : kNoSurface;
    }
    return height + lean * (length - std::max(along, 0.0));
  });
}

Object spanner(Draw& d, Draw& press) {
  const double jaw = d.uniform(5, 12);
  const double outer = d.uniform(0.95, 1.15) * jaw;
  const double skew = d.uniform(0.15, 0.4);
  const double handle = d.uniform(0.35, 0.5) * jaw;
  const double sunk = d.uniform(0, 1.2);
  const double chamfer = d.uniform(0.1, 0.5);
  const double wall = d.uniform(0.22, 0.3) * jaw;
  const bool ring = press.chance(0.35);
  return object([=](double x, double y) {
    const double bar = x < 0 ? kNoSurface : face(std::abs(y) - handle, chamfer) + sunk;
    if (ring) {
      const double r = std::hypot(x, y);
      const double corners = 0.04 * jaw * std::cos(12 * std::atan2(y, x));
      if (r < 0.54 * jaw + corners) return kNoSurface;
      return std::min(bar, face(r - 0.54 * jaw - wall, chamfer));
    }
    const double u = std::cos(skew) * x + std::sin(skew) * y;
    const double v = std::cos(skew) * y - std::sin(skew) * x;
    const double slot = u < 0 ? std::abs(v) : std::hypot(u, v);
    if (slot < jaw / 2) return kNoSurface;
    const double hook = std::max(circle(u, v, outer), -0.75 * jaw - u);
    return std::min(bar, face(hook, chamfer));
  });
}

Object brick(Draw& d, Draw& press, int rows, int columns) {
  const double scale = d.uniform(0.88, 1.08);
  const double tall = d.uniform(1.5, 1.9);
  const double radius = d.uniform(2.3, 2.5) * scale;
  const double pitch = 8 * scale;
  const double wall = d.uniform(1.2, 1.6) * scale;
  const double round = d.uniform(0, 0.3);
  const double hole = d.chance(0.3) ? d.uniform(1, 1.6) * scale : 0;
  const double half_x = columns * pitch / 2 - 0.1;
  const double half_y = rows * pitch / 2 - 0.1;
  if (press.chance(0.4)) {  // its open underside
    return object([=](double x, double y) {
      const double rim = box(x, y, half_x, half_y);
      if (rim > 0) return kNoSurface;
      if (rim > -wall) return face(rim, round);
      // Tubes between four studs, a post between two.
      const double tube = std::abs(std::abs(x) - (columns - 2) * pitch / 2);
      const double r = std::hypot(columns == 2 ? x : tube, y);
      const bool solid = rows == 1 ? r < 1.6 * scale : r < 3.25 * scale && r > 2.4 * scale;
      return solid ? 0 : kNoSurface;
    });
  }
  return object([=](double x, double y) {
    if (box(x, y, half_x, half_y) > 0) return kNoSurface;
    const auto stud = [&](double at, int count) {
      const double first = -(count - 1) * pitch / 2;
      return at - first - pitch * std::clamp(std::round((at - first) / pitch), 0.0, count - 1.0);
    };
    const double r = std::hypot(stud(x, columns), stud(y, rows));
    return r > radius || r < hole ? tall : face(r - radius, round);
  });
}

Object usb_mini(Draw& d, Draw& press) {
  const double half = d.uniform(3.3, 3.5);
  const double foot = d.uniform(0.74, 0.82) * half;
  const double thick = d.uniform(2.9, 3.1);
  const double length = d.uniform(5.5, 8);
  const double wall = d.uniform(0.35, 0.55);
  const double rib = d.uniform(0.8, 1.1);
  if (press.chance(0.45)) {  // its mouth
    return object([=](double x, double y) {
      const auto outline = [&](double inset) {
        return std::min(box(x, y + thick / 4, half - inset, thick / 4 + 0.2 - inset),
                        box(x, y, foot - inset, thick / 2 - inset));
      };
      return outline(0) <= 0 && outline(wall) > 0 ? 0 : kNoSurface;
    });
  }
  const bool narrow = press.chance(0.5);
  return object([=](double x, double y) {
    const double v = std::abs(y);
    if (std::abs(x) > length / 2 || v > half) return kNoSurface;
    const double flat = (narrow ? foot : half) - 0.3;
    const double side = v <= flat ? 0 : narrow && v > flat + 0.3 ? thick / 2 : (v - flat);
    // The wide side has two grooves along it.
    const bool groove = !narrow && std::abs(v - half / 2) < rib / 2;
    return side + (groove ? 0.4 : 0);
  });
}

Object usb_c(Draw& d, Draw& press) {
  const double half = d.uniform(4.0, 4.25);
  const double thick = d.uniform(2.3, 2.5);
  const double length = d.uniform(6, 7.5);
  const double wall = d.uniform(0.35, 0.6);
  if (press.chance(0.45)) {
    return object([=](double x, double y) {
      const double r = std::hypot(std::max(std::abs(x) - half + thick / 2, 0.0), y) - thick / 2;
      return r <= 0 && r > -wall ? face(r, 0.1) : kNoSurface;
    });
  }
  return object([=](double x, double y) {
    if (std::abs(x) > length / 2) return kNoSurface;
    return round_top(thick / 2, std::max(std::abs(y) - half + thick / 2, 0.0));
  });
}

Object key(Draw& d, Draw& press) {
  const double bow = d.uniform(5, 11);
  const bool square = d.chance(0.3);
  const double hole = d.uniform(1.2, 3);
  const double blade = d.uniform(2.6, 4.2);
  const double length = d.uniform(16, 26);
  const double chamfer = d.uniform(0, 0.3);
  const double groove = d.uniform(-0.5, 0.5) * blade;
  const double groove_deep = d.uniform(0.3, 0.8);
  const bool both = d.chance(0.4);
  const int count = d.between(4, 7);
  std::array<double, 7> cuts;
  for (double& cut : cuts) cut = d.uniform(0.15, 0.5) * blade;
  const double first = d.uniform(3, 5);
  const double pitch = (length - first - 2) / count;
  const double from = press.uniform(-0.3, 0.9) * length;
  return object([=](double at, double y) {
    const double x = at + from;
    const double head = square ? box(x + bow, y, bow, bow) : circle(x + bow, y, bow);
    if (head <= 0) return circle(x + 1.4 * bow, y, hole) < 0 ? kNoSurface : face(head, chamfer);
    double side = box(x - length / 2 + 1, y, length / 2 + 1, blade);
    side = std::max(side, x - length + std::abs(y) * 0.8);
    for (int i = 0; i < count; ++i) {
      const double along = std::max(std::abs(x - first - pitch * i) - pitch / 6, 0.0);
      const double v = both ? std::abs(y) : y;
      side = std::max(side, v - blade + cuts[static_cast<std::size_t>(i)] - along);
    }
    return face(side, chamfer) + (std::abs(y - groove) < 0.6 ? groove_deep : 0);
  });
}

Object hex_key(Draw& d, Draw& press) {
  const double flats = d.uniform(1.5, 7);
  const double shorter = d.uniform(10, 22);
  const double bend = d.uniform(1.2, 2) * flats;
  const bool on_edge = press.chance(0.3);
  const double shift = press.chance(0.5) ? 0 : press.uniform(0, 14);
  return object([=](double at, double y) {
    const double x = at + shift;  // the bend is at the origin; the longer arm never ends
    double across = 0;
    if (x < bend && y < bend) {
      across = std::abs(std::hypot(bend - x, bend - y) - bend);
    } else {
      across = x > y ? std::abs(y) : y > shorter ? kReach : std::abs(x);
    }
    return hexagonal_bar(across, flats, on_edge);
  });
}

Object pen_holder(Draw& d, Draw&) {
  const double radius = d.uniform(32, 50);
  const double pitch = d.uniform(1.8, 4.5);
  const double wire = d.uniform(0.25, 0.4) * pitch;
  const int pattern = d.index(3);
  const double stretch = d.uniform(1, 1.8);
  const double turn = d.chance(0.5) ? 0 : kPi / 4;
  return object([=](double x, double y) {
    const double u = (std::cos(turn) * x + std::sin(turn) * y) / (pattern == 2 ? stretch : 1);
    const double v = std::cos(turn) * y - std::sin(turn) * x;
    double from_hole = 0;
    if (pattern == 1) {  // round or hexagonal holes in staggered rows
      const double row = std::round(v / (kCos30 * pitch));
      const double shifted = u / pitch + 0.5 * std::fmod(std::abs(row), 2);
      from_hole = std::hypot((shifted - std::round(shifted)) * pitch, v - row * kCos30 * pitch);
    } else {
      from_hole = std::max(std::abs(u - pitch * std::round(u / pitch)),
                           std::abs(v - pitch * std::round(v / pitch)));
    }
    return from_hole < (pitch - wire) / 2 ? kNoSurface : y * y / (2 * radius);
  });
}

}  // namespace

const std::vector<std::string>& kinds() {
  static const std::vector<std::string> kKinds = {
      "ball", "cylinder", "nut", "bolt", "spanner", "brick 1x2", "brick 2x3", "USB mini plug",
      "USB-C plug", "key", "hex key", "mesh pen holder",
      // Other shapes.
      "washer", "grating", "pin board", "balls", "coin", "edge", "box", "star", "two pillars",
      "waves", "torus", "bumps", "polygon", "cone", "cross", "ellipsoid", "ridge", "wire", "letter",
      "fabric", "screw cap", "gear", "die", "spring"};
  return kKinds;
}

Object draw_object(int kind, int variant, Draw& press) {
  Draw d(whole::seed_of(48, 1000 * kind + variant));
  switch (kind) {
    case 0:
      return sim::ball(d.uniform(2, 8));
    case 1:
      return cylinder(d, press);
    case 2:
      return nut(d, press);
    case 3:
      return bolt(d, press);
    case 4:
      return spanner(d, press);
    case 5:
      return brick(d, press, 1, 2);
    case 6:
      return brick(d, press, 2, 3);
    case 7:
      return usb_mini(d, press);
    case 8:
      return usb_c(d, press);
    case 9:
      return key(d, press);
    case 10:
      return hex_key(d, press);
    case 11:
      return pen_holder(d, press);
    default:
      return other_shape(kind - kClasses, d, press);
  }
}

Object placed(const Object& object, const Placing& placing, double half_width_mm,
              double half_height_mm) {
  const double c = std::cos(placing.rotation);
  const double s = std::sin(placing.rotation);
  const auto height = [=](double x, double y) {
    if (std::abs(x) > half_width_mm || std::abs(y) > half_height_mm) return kNoSurface;
    const double dx = x - placing.x_mm;
    const double dy = y - placing.y_mm;
    return object.height_mm(c * dx + s * dy, c * dy - s * dx) + placing.slope_x * dx +
           placing.slope_y * dy;
  };
  constexpr double kStepMm = 0.1;
  double lowest = kNoSurface;
  for (double y = -half_height_mm; y < half_height_mm; y += kStepMm) {
    for (double x = -half_width_mm; x < half_width_mm; x += kStepMm) {
      lowest = std::min(lowest, height(x, y));
    }
  }
  return {object.kind, std::max(half_width_mm, half_height_mm),
          [=](double x, double y) { return height(x, y) - lowest; }};
}

}  // namespace dtact::recognition
