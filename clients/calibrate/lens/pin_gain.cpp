#include "clients/calibrate/lens/pin_gain.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

namespace dtact::ctl {
namespace {

constexpr double kUnit = 10;  // mm, so that x² is of the order of one

/// A pin: its darkening and position, in units.
struct Pin {
  double x = 0;
  double y = 0;
  double levels = 0;
};

/// levels · (1 + q·(x², xy, y²)) = plane: all pins are equally long, the board may be tilted.
struct Surface {
  std::array<double, 3> plane = {};
  std::array<double, 3> q = {};

  [[nodiscard]] double gain(const Pin& pin) const {
    return 1 + q[0] * pin.x * pin.x + q[1] * pin.x * pin.y + q[2] * pin.y * pin.y;
  }
  /// Relative error.
  [[nodiscard]] double error(const Pin& pin) const {
    const double expected = plane[0] + plane[1] * pin.x + plane[2] * pin.y;
    return (pin.levels * gain(pin) - expected) / expected;
  }
};

/// Least squares over all pins but `out`.
Surface fit(const std::vector<Pin>& pins, bool quadratic, std::size_t out) {
  const Eigen::Index terms = quadratic ? 6 : 3;
  const auto count = static_cast<Eigen::Index>(pins.size() - (out < pins.size() ? 1 : 0));
  Eigen::MatrixXd a(count, terms);
  Eigen::VectorXd b(count);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < pins.size(); ++i) {
    if (i == out) continue;
    const Pin& p = pins[i];
    Eigen::RowVectorXd all(6);
    all << 1, p.x, p.y, -p.levels * p.x * p.x, -p.levels * p.x * p.y, -p.levels * p.y * p.y;
    a.row(row) = all.head(terms);
    b[row++] = p.levels;
  }
  const Eigen::VectorXd x = a.completeOrthogonalDecomposition().solve(b);
  Surface surface{{x[0], x[1], x[2]}, {}};
  if (quadratic) surface.q = {x[3], x[4], x[5]};
  return surface;
}

struct LeftOutPins {
  std::vector<double> squares;
  std::vector<double> gain;  ///< At each pin, from the surface through the others.
};

LeftOutPins leave_pins_out(const std::vector<Pin>& pins, bool quadratic) {
  LeftOutPins result;
  for (std::size_t out = 0; out < pins.size(); ++out) {
    const Surface surface = fit(pins, quadratic, out);
    const double error = surface.error(pins[out]);
    result.squares.push_back(error * error);
    result.gain.push_back(surface.gain(pins[out]));
  }
  return result;
}

double root_mean(const std::vector<double>& squares) {
  double sum = 0;
  for (const double square : squares) sum += square;
  return std::sqrt(sum / static_cast<double>(squares.size()));
}

/// Values of a smoothed image at the marks.
std::vector<float> read(const cv::Mat1f& image, std::span<const Mark> marks, double sigma) {
  cv::Mat1f smooth;
  cv::GaussianBlur(image, smooth, {}, sigma, sigma, cv::BORDER_REPLICATE);
  cv::Mat2f places(1, static_cast<int>(marks.size()));
  std::ranges::transform(marks, places.begin(), [](const Mark& mark) {
    return cv::Vec2f(static_cast<float>(mark.px.x), static_cast<float>(mark.px.y));
  });
  cv::Mat1f values;
  cv::remap(smooth, values, places, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return {values.begin(), values.end()};
}

}  // namespace

std::string PinGain::describe() const {
  const std::string text = fmt::format(
      "gain: pins differ from what the others predict by {:.1f} % as they are, {:.1f} % as a share "
      "of the light, {:.1f} % with a quadratic: ",
      100 * left_out_of_each[0], 100 * left_out_of_each[1], 100 * left_out_of_each[2]);
  if (!gain.polynomial.empty()) return text + "the quadratic is used";
  return text + (gain.shape == recon::GainShape::uniform ? "the share is used" : "none is used");
}

PinGain choose_gain(const cv::Mat1f& reference, const cv::Mat1f& frame, std::span<const Mark> marks,
                    double smoothing_px) {
  constexpr std::size_t kFewest = 12;  // twice the quadratic's parameters
  if (marks.size() < kFewest) throw std::runtime_error("gain: too few pins");
  const std::vector<float> light = read(reference, marks, smoothing_px);
  const std::vector<float> levels = read(cv::Mat1f(reference - frame), marks, smoothing_px);
  std::vector<Pin> plain;
  std::vector<Pin> share;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const Pin pin{marks[i].mm.x / kUnit, marks[i].mm.y / kUnit, levels[i]};
    plain.push_back(pin);
    share.push_back({pin.x, pin.y, levels[i] / std::max(light[i], 1.0F)});
  }
  PinGain chosen;
  LeftOutPins best = leave_pins_out(plain, false);
  const LeftOutPins lit = leave_pins_out(share, false);
  const LeftOutPins quadratic = leave_pins_out(plain, true);
  for (const LeftOutPins* one :
       std::initializer_list<const LeftOutPins*>{&best, &lit, &quadratic}) {
    chosen.left_out_of_each.push_back(root_mean(one->squares));
  }
  chosen.left_out_ratio.assign(marks.size(), 1.0);
  if (clearly_lower(lit.squares, best.squares)) {
    chosen.gain.shape = recon::GainShape::uniform;
    best = lit;
  }
  if (clearly_lower(quadratic.squares, best.squares)) {
    const Surface surface = fit(plain, true, plain.size());
    chosen.gain = {};
    chosen.gain.polynomial = {0, 0};
    for (const double q : surface.q) chosen.gain.polynomial.push_back(q / (kUnit * kUnit));
    for (std::size_t i = 0; i < marks.size(); ++i) {
      chosen.left_out_ratio[i] = quadratic.gain[i] / surface.gain(plain[i]);
    }
  }
  return chosen;
}

BoardLens measure_board(const cv::Mat1f& reference, const cv::Mat1f& frame, const Board& board,
                        double smoothing_mm) {
  PinPress pins = find_pins(reference, frame, board);
  PinGain gain = choose_gain(reference, frame, pins.marks,
                             smoothing_mm / recon::central_mm_per_px(pins.lens.lens));
  const PinShift shift =
      measure_pin_shift(reference, frame, pins.marks, pins.lens.lens, board.pitch_mm);
  if (shift.sure()) pins.lens.lens = undeformed(pins.lens.lens, shift);
  return {std::move(pins), std::move(gain), shift};
}

}  // namespace dtact::ctl
