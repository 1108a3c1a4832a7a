#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/recognition/objects.hpp"
#include "tests/recognition/outlines.hpp"

namespace dtact::recognition {
namespace {

namespace sim = hal::sim;
using sim::kNoSurface;
using sim::Object;
using whole::Draw;

double segment(double x, double y, double ax, double ay, double bx, double by) {
  const double dx = bx - ax;
  const double dy = by - ay;
  const double t = std::clamp(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
  return std::hypot(x - ax - t * dx, y - ay - t * dy);
}

/// Random smooth relief: a sum of waves, about 1 in height, of the given length.
auto relief(Draw& draw, double length_mm) {
  struct Wave {
    double kx, ky, phase;
  };
  std::array<Wave, 12> waves;
  for (Wave& wave : waves) {
    const double k = 2 * kPi / (length_mm * draw.uniform(0.8, 2));
    const double angle = draw.uniform(0, 2 * kPi);
    wave = {k * std::cos(angle), k * std::sin(angle), draw.uniform(0, 2 * kPi)};
  }
  return [waves](double x, double y) {
    double sum = 0;
    for (const Wave& wave : waves) sum += std::sin(wave.kx * x + wave.ky * y + wave.phase);
    return sum / 5;
  };
}

Object letters(Draw& d) {
  // Strokes on a grid of 3 columns and 5 rows: from column, row to column, row.
  static const std::vector<std::string> kLetters = {
      "0410103014242220", "000414",     "002020140404",  "000402221404",
      "002024040400",     "00042024",   "0004200202 24", "002002222404",
      "001020210224",     "0020102400", "00042420",      "04002024"};
  const std::string& strokes = kLetters[static_cast<std::size_t>(d.index(12))];
  const double size = d.uniform(1, 2.6);
  const double width = d.uniform(0.35, 0.7);
  const bool sunk = d.chance(0.3);
  std::vector<std::array<double, 4>> lines;
  std::string digits;
  for (const char c : strokes) digits += c == ' ' ? "" : std::string(1, c);
  for (std::size_t i = 0; i + 3 < digits.size(); i += 2) {
    const auto at = [&](std::size_t k) { return digits[i + k] - '0'; };
    const std::array<double, 4> line = {(at(0) - 1) * size, (at(1) - 2) * size, (at(2) - 1) * size,
                                        (at(3) - 2) * size};
    if (line[0] != line[2] || line[1] != line[3]) lines.push_back(line);
  }
  return object([=](double x, double y) {
    double nearest = kReach;
    for (const auto& line : lines) {
      nearest = std::min(nearest, segment(x, y, line[0], line[1], line[2], line[3]));
    }
    if (sunk)
      return std::abs(x) > 2 * size || std::abs(y) > 3 * size ? kNoSurface
             : nearest < width                                ? 0.8
                                                              : 0.0;
    return nearest < width ? 0.0 : 1.0;
  });
}

Object gear(Draw& d) {
  const double radius = d.uniform(4, 10);
  const int teeth = d.between(8, 24);
  const double tooth = d.uniform(0.08, 0.2) * radius;
  const double bore = d.uniform(0.15, 0.5) * radius;
  return object([=](double x, double y) {
    const double r = std::hypot(x, y);
    const double rim = radius + tooth * std::clamp(2 * std::sin(teeth * std::atan2(y, x)), -1., 1.);
    return r < bore || r > rim ? kNoSurface : 0;
  });
}

Object coin(Draw& d) {
  const double radius = d.uniform(7, 13);
  const double rim = d.uniform(0.5, 1.2);
  const double sunk = d.uniform(0.15, 0.4);
  const auto picture = relief(d, d.uniform(1.5, 4));
  return object([=](double x, double y) {
    const double edge = circle(x, y, radius);
    if (edge > 0) return kNoSurface;
    return edge > -rim ? face(edge, 0.2) : sunk * std::clamp(0.5 - picture(x, y), 0.0, 1.0);
  });
}

Object spring(Draw& d) {
  const double radius = d.uniform(2, 6);
  const double wire = d.uniform(0.3, 0.8);
  const double pitch = d.uniform(2.5, 5) * wire;
  return object([=](double x, double y) {
    if (std::abs(y) > radius) return kNoSurface;
    const double turns = x / pitch + std::asin(y / radius) / (2 * kPi);
    const double across = std::abs(turns - std::round(turns)) * pitch;
    return round_top(wire, across) + radius - std::sqrt(radius * radius - y * y);
  });
}

Object polygon(Draw& d, int corners, double chamfer) {
  std::vector<std::array<double, 3>> sides;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2 * kPi * (i + d.uniform(-0.3, 0.3)) / corners;
    sides.push_back({std::cos(angle), std::sin(angle), d.uniform(2, 7)});
  }
  return object([=](double x, double y) {
    double outline = -kReach;
    for (const auto& [c, s, far] : sides) outline = std::max(outline, c * x + s * y - far);
    return face(outline, chamfer);
  });
}

Object dice(Draw& d, Draw& press) {
  const double half = d.uniform(4, 7);
  const double pip = d.uniform(0.12, 0.18) * half;
  const int shown = press.between(1, 6);
  const double round = d.uniform(0.3, 1);
  return object([=](double x, double y) {
    const double step = half / 2;
    bool hole = shown % 2 == 1 && std::hypot(x, y) < pip;
    hole |=
        shown > 1 && std::min(std::hypot(x - step, y - step), std::hypot(x + step, y + step)) < pip;
    hole |=
        shown > 3 && std::min(std::hypot(x + step, y - step), std::hypot(x - step, y + step)) < pip;
    hole |= shown == 6 && std::min(std::hypot(x - step, y), std::hypot(x + step, y)) < pip;
    return hole ? 1.0 : face(box(x, y, half, half), round);
  });
}

}  // namespace

Object other_shape(int family, Draw& d, Draw& press) {
  switch (family) {
    case 0: {
      const double outer = d.uniform(3, 9);
      const double inner = d.uniform(0.3, 0.75) * outer;
      return object([=](double x, double y) {
        const double r = std::hypot(x, y);
        return r < inner ? kNoSurface : face(r - outer, 0.2);
      });
    }
    case 1:
      return sim::grating(d.uniform(1, 4), d.uniform(0.3, 1.5), d.uniform(5, 22));
    case 2: {
      const double pitch = d.uniform(1.4, 4);
      const double radius = d.uniform(0.15, 0.4) * pitch;
      const bool round = d.chance(0.6);
      const double tall = d.uniform(0.8, 2);
      return object([=](double x, double y) {
        const double r =
            std::hypot(x - pitch * std::round(x / pitch), y - pitch * std::round(y / pitch));
        return r > radius ? tall : round ? std::min(tall, round_top(radius, r)) : 0.0;
      });
    }
    case 3: {
      const double radius = d.uniform(0.8, 2.5);
      return sim::ball_array(radius, d.uniform(2.05, 3) * radius, d.between(1, 3), d.between(2, 4));
    }
    case 4:
      return coin(d);
    case 5: {  // an edge of a plate
      const double radius = d.uniform(0.1, 3);
      return object([=](double x, double) {
        return x > radius ? 0 : x > 0 ? round_top(radius, radius - x) : kNoSurface;
      });
    }
    case 6: {
      const double half_x = d.uniform(2, 12);
      const double half_y = d.uniform(2, 8);
      const double round = d.uniform(0, 1);
      return object([=](double x, double y) { return face(box(x, y, half_x, half_y), round); });
    }
    case 7:
      return sim::star(d.uniform(3, 9));
    case 8: {
      const double radius = d.uniform(0.8, 3);
      return sim::two_pillars(radius, 2 * radius + d.uniform(0.5, 5));
    }
    case 9: {  // waves in two directions
      const double kx = 2 * kPi / d.uniform(1.5, 6);
      const double ky = d.chance(0.3) ? 0 : 2 * kPi / d.uniform(1.5, 6);
      const double high = d.uniform(0.2, 1);
      return object(
          [=](double x, double y) { return high * (2 - std::cos(kx * x) - std::cos(ky * y)) / 2; });
    }
    case 10: {
      const double radius = d.uniform(2.5, 8);
      const double wire = d.uniform(0.15, 0.4) * radius;
      return object(
          [=](double x, double y) { return round_top(wire, std::abs(circle(x, y, radius))); });
    }
    case 11: {
      const double length = d.uniform(2.5, 7);
      const double high = d.uniform(0.8, 2.5);
      return object([=, bumps = relief(d, length)](double x, double y) {
        return high * (1 - bumps(x, y)) + 0.01 * (x * x + y * y);
      });
    }
    case 12:
      return polygon(d, d.between(3, 5), d.uniform(0, 0.8));
    case 13: {  // a cone or a pyramid
      const double slope = d.uniform(0.2, 0.9);
      const bool round = d.chance(0.5);
      const double tip = d.uniform(0, 0.6);
      return object([=](double x, double y) {
        const double r = round ? std::hypot(x, y) : std::max(std::abs(x), std::abs(y));
        return r > 8 ? kNoSurface : slope * std::max(0.0, r - tip);
      });
    }
    case 14: {
      const double arm = d.uniform(3, 9);
      const double half = d.uniform(0.5, 1.8);
      return object([=](double x, double y) {
        return face(std::min(box(x, y, arm, half), box(x, y, half, arm)), 0.1);
      });
    }
    case 15: {
      const double a = d.uniform(1.5, 3.5);
      const double b = a * d.uniform(1.6, 4);
      const double high = d.uniform(0.8, 1.5) * a;
      return object([=](double x, double y) {
        const double r = std::hypot(x / b, y / a);
        return r < 1 ? high * (1 - std::sqrt(1 - r * r)) : kNoSurface;
      });
    }
    case 16: {  // a roof's ridge
      const double slope = d.uniform(0.3, 1.2);
      const double flat = d.uniform(0, 0.4);
      const double length = d.uniform(4, 30);
      return object([=](double x, double y) {
        if (std::abs(x) > length / 2) return kNoSurface;
        return slope * std::max(0.0, std::abs(y) - flat);
      });
    }
    case 17: {  // bent wires
      const double radius = d.uniform(0.4, 1.2);
      const double bend = d.uniform(2, 8);
      const double wave = 2 * kPi / d.uniform(6, 20);
      return object([=](double x, double y) {
        const double slope = bend * wave * std::cos(wave * x);
        return round_top(radius, std::abs(y - bend * std::sin(wave * x)) / std::hypot(1, slope));
      });
    }
    case 18:
      return letters(d);
    // Families for tests only.
    case 19: {
      const double pitch = d.uniform(1.2, 3);
      const double high = d.uniform(0.3, 0.8);
      return object([=](double x, double y) {
        const double column = std::round(x / pitch);
        const double row = std::round(y / pitch);
        const double over =
            std::fmod(std::abs(column + row), 2) < 1 ? x - column * pitch : y - row * pitch;
        const double across =
            std::fmod(std::abs(column + row), 2) < 1 ? y - row * pitch : x - column * pitch;
        const double u = 2 * over / pitch;
        const double v = 2 * across / pitch;
        return high * std::min(2.0, u * u + 0.8 * v * v);
      });
    }
    case 20: {
      const double opening = d.uniform(4, 8);
      const double wall = d.uniform(0.8, 1.6);
      const int ribs = d.between(20, 40);
      return object([=](double x, double y) {
        const double r = std::hypot(x, y);
        const double rib = std::cos(ribs * std::atan2(y, x)) > 0 ? 0.3 : 0;
        return r >= opening && r <= opening + wall + rib ? 0 : kNoSurface;
      });
    }
    case 21:
      return gear(d);
    case 22:
      return dice(d, press);
    default:
      return spring(d);
  }
}

}  // namespace dtact::recognition
