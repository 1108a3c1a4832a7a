#include "clients/calibrate/fit/camera_height.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "clients/calibrate/fit/least_squares.hpp"

namespace dtact::calibration {
namespace {

constexpr double kLevelsApart = 4;  // grey levels from knot to knot
constexpr double kSmooth = 0.02;    // weight of a knot's bend, in shares of all samples
constexpr int kSteps = 10;
/// In two simulated gels the mean over six to ten sets of presses is up to 0.003 off: light
/// scatters differently in contacts of different width.
constexpr double kOfScattering = 0.003;
constexpr Eigen::Index kTerms = 3;

/// Terms of the gain at a place, mm from the map's middle.
std::array<double, kTerms> field_terms(double x, double y) { return {x, y, x * x + y * y}; }

/// A press as it appears.
struct SeenPress {
  std::vector<PressSample> samples;  ///< Places from the map's middle.
  Contact contact;
  recon::Point centre_mm;
};

std::vector<SeenPress> look(const BallPresses& set, const Calibration& empty) {
  recon::Model model = *empty.model;
  model.surface.view = {};
  std::vector<SeenPress> presses;
  const UsablePresses usable = settle_each(model, set);  // build() names those left out
  for (const SettledPress& settled : usable.presses) {
    const Contact& contact = settled.contact;
    const DarkeningMap& map = settled.map;
    SeenPress seen{sure_samples(map, contact),
                   contact,
                   {(contact.col - 0.5 * (map.width - 1)) * map.mm_per_px,
                    (contact.row - 0.5 * (map.height - 1)) * map.mm_per_px}};
    for (PressSample& sample : seen.samples) {
      sample.x_mm += seen.centre_mm.x;
      sample.y_mm += seen.centre_mm.y;
    }
    presses.push_back(std::move(seen));
  }
  return presses;
}

/// 1 / height by Gauss and Newton, without press `without`.
double fit_per_mm(const std::vector<SeenPress>& presses, recon::Point foot, std::size_t without) {
  const double ball = presses.front().contact.ball_radius_mm;
  double deepest = 0;
  for (const SeenPress& press : presses) deepest = std::max(deepest, press.contact.peak_levels);
  const auto knots = static_cast<Eigen::Index>(std::ceil(deepest / kLevelsApart)) + 2;
  // Unknowns: the LUT's knots, the gain's terms, 1 / height, three of each press.
  const Eigen::Index height = knots + kTerms;
  const auto own = [&](std::size_t press) {
    return height + 1 + 3 * static_cast<Eigen::Index>(press);
  };
  Eigen::VectorXd now = Eigen::VectorXd::Zero(own(presses.size()));
  const Contact& first = presses.front().contact;
  const double slope = sag_mm(ball, first.radius_mm) / first.peak_levels;
  for (Eigen::Index k = 0; k < knots; ++k) now[k] = slope * kLevelsApart * static_cast<double>(k);
  now[height] = kAssumedPerMm;
  for (std::size_t p = 0; p < presses.size(); ++p) {
    now.segment<3>(own(p)) << presses[p].centre_mm.x, presses[p].centre_mm.y,
        slope * presses[p].contact.peak_levels;
  }
  for (int round = 0; round < kSteps; ++round) {
    LeastSquares squares(now.size());
    std::vector<LeastSquares::Term> row;
    for (std::size_t p = 0; p < presses.size(); ++p) {
      if (p == without) continue;
      const double weight = 1 / static_cast<double>(presses[p].samples.size());
      for (const PressSample& s : presses[p].samples) {
        const std::array<double, kTerms> terms = field_terms(s.x_mm, s.y_mm);
        double gain = 1;
        for (Eigen::Index t = 0; t < kTerms; ++t) {
          gain += now[knots + t] * terms[static_cast<std::size_t>(t)];
        }
        const auto [below, part] = between_knots(gain * s.level / kLevelsApart, knots);
        const double depth = std::lerp(now[below], now[below + 1], part);
        const double right = s.x_mm - foot.x;
        const double down = s.y_mm - foot.y;
        const double dx = s.x_mm - right * now[height] * depth - now[own(p)];
        const double dy = s.y_mm - down * now[height] * depth - now[own(p) + 1];
        const double rise =
            std::sqrt(std::max(0.01 * ball * ball, ball * ball - dx * dx - dy * dy));
        const double out = (right * dx + down * dy) / rise;  // sag gained per share moved outwards
        const double by_depth = 1 - now[height] * out;
        row = {{below, by_depth * (1 - part)}, {below + 1, by_depth * part}, {height, -out * depth},
               {own(p), -dx / rise},           {own(p) + 1, -dy / rise},     {own(p) + 2, -1}};
        for (Eigen::Index t = 0; t < kTerms; ++t) {
          row.push_back({knots + t, by_depth * (now[below + 1] - now[below]) / kLevelsApart *
                                        s.level * terms[static_cast<std::size_t>(t)]});
        }
        double value = now[own(p) + 2] - depth - sag_mm(ball, std::hypot(dx, dy));
        for (const auto& [unknown, factor] : row) value += factor * now[unknown];
        squares.add(row, value, weight);
      }
    }
    const auto count = static_cast<double>(presses.size());
    squares.straighten(0, knots, kSmooth * count);
    squares.add({{0, 1}}, 0, count);
    now = squares.solve();
    if (!now.allFinite()) return NAN;
  }
  return now[height];
}

}  // namespace

CameraView view_of_presses(const BallPresses& set) {
  if (set.view.source != HeightSource::assumed || set.presses.size() < kHeightPresses) {
    return set.view;
  }
  const Calibration empty =
      empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
  const std::vector<SeenPress> presses = look(set, empty);
  if (presses.size() < kHeightPresses) return set.view;
  const recon::Point foot = empty.view.foot_mm;
  const double per_mm = fit_per_mm(presses, foot, presses.size());
  const auto count = static_cast<double>(presses.size());
  double sum = 0;
  double squares = 0;
  for (std::size_t p = 0; p < presses.size(); ++p) {
    const double off = fit_per_mm(presses, foot, p) - per_mm;
    sum += off;
    squares += off * off;
  }
  const double error =
      std::hypot(std::sqrt((count - 1) / count * (squares - sum * sum / count)), kOfScattering);
  if (!(per_mm > 4 * error && per_mm >= kMinPerMm && per_mm <= kMaxPerMm)) return set.view;
  return {set.view.foot_mm, HeightSource::presses, per_mm, 0, error};
}

}  // namespace dtact::calibration
