#include "clients/calibrate/force/force_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <stdexcept>

namespace dtact::force {
namespace {

constexpr double kLeastRank = 0.8;
constexpr double kSoftest = 0.02;  // N per mm³
constexpr double kHardest = 5;

cv::Vec3d features(const Pair& pair) {
  return {pair.volume_mm3, pair.area_mm2, pair.volume_mm3 * pair.area_mm2};
}

// The place of each value among them, from 0; equal ones share the mean of theirs.
std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<double> out;
  out.reserve(values.size());
  for (const double value : values) {
    const auto below = std::ranges::count_if(values, [&](double v) { return v < value; });
    const auto equal = std::ranges::count(values, value);
    out.push_back(static_cast<double>(below) + (static_cast<double>(equal) - 1) / 2);
  }
  return out;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double ab = 0;
  double aa = 0;
  double bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

void check(const std::vector<Pair>& pairs) {
  if (pairs.size() < kLeastPairs) {
    throw std::invalid_argument(
        fmt::format("{} pairs of contact and reading are too few: at least {}, of light to heavy "
                    "loads and with objects as different as those to be measured",
                    pairs.size(), kLeastPairs));
  }
  std::vector<double> volumes;
  std::vector<double> readings;
  std::vector<double> ratios;
  for (const Pair& pair : pairs) {
    if (!(pair.volume_mm3 > 0 && pair.area_mm2 > 0)) {
      throw std::invalid_argument(
          fmt::format("{}: nothing touches in it: take the pair out, or the picture while the "
                      "scale shows the load",
                      pair.name));
    }
    if (!(pair.newtons > 0)) {
      throw std::invalid_argument(fmt::format(
          "{}: its reading of {} N is not above 0: zero the scale with the sensor on it, and let "
          "a heavier load read more",
          pair.name, pair.newtons));
    }
    volumes.push_back(pair.volume_mm3);
    readings.push_back(pair.newtons);
    ratios.push_back(pair.newtons / pair.volume_mm3);
  }
  if (const double rank = correlation(ranks(volumes), ranks(readings)); rank < kLeastRank) {
    throw std::invalid_argument(fmt::format(
        "the readings do not grow with the pressed volume (rank correlation {:.2f}, at least {}): "
        "are readings and pictures of the same moments, and in the same order?",
        rank, kLeastRank));
  }
  std::ranges::nth_element(ratios, ratios.begin() + std::ssize(ratios) / 2);
  const double ratio = ratios[ratios.size() / 2];
  if (ratio < kSoftest || ratio > kHardest) {
    throw std::invalid_argument(fmt::format(
        "the readings are {:.3g} N for each mm3 that is pressed, silicones give {} to {}: they "
        "have to be in newtons ({}), and the calibration's millimetres right",
        ratio, kSoftest, kHardest,
        ratio > kHardest ? "1 g weighs 0.00981 N; --grams takes grams" : "1 kg weighs 9.81 N"));
  }
}

}  // namespace

Fit fit_force(const std::vector<Pair>& pairs, double threshold_mm, int sharpen_steps) {
  check(pairs);
  const auto n = static_cast<double>(pairs.size());
  cv::Vec3d squares;
  for (const Pair& pair : pairs) squares += features(pair).mul(features(pair));
  const cv::Vec3d scale(std::sqrt(squares[0] / n), std::sqrt(squares[1] / n),
                        std::sqrt(squares[2] / n));
  const auto scaled = [&](const Pair& pair) {
    const cv::Vec3d x = features(pair);
    return cv::Vec3d(x[0] / scale[0], x[1] / scale[1], x[2] / scale[2]);
  };

  cv::Matx33d normal = cv::Matx33d::zeros();
  cv::Vec3d right;
  for (const Pair& pair : pairs) {
    const cv::Vec3d x = scaled(pair);
    normal += x * x.t();
    right += x * pair.newtons;
  }

  Fit best;
  best.model.error_n = std::numeric_limits<double>::infinity();
  for (int power = -8; power <= 0; ++power) {
    const double ridge = std::pow(10.0, power);
    const cv::Matx33d inverse = (normal + n * ridge * cv::Matx33d::eye()).inv(cv::DECOMP_CHOLESKY);
    const cv::Vec3d weights = inverse * right;
    Fit fit;
    double sum = 0;
    for (const Pair& pair : pairs) {
      const cv::Vec3d x = scaled(pair);
      // What a fit without this pair would say of it, from the whole fit's residual and leverage.
      const double error = (x.dot(weights) - pair.newtons) / (1 - x.dot(inverse * x));
      fit.left_out.push_back(error);
      sum += std::abs(error);
    }
    if (sum / n > best.model.error_n) continue;
    fit.ridge = ridge;
    recon::ForceModel& model = fit.model;
    model.error_n = sum / n;
    model.per_mm3 = weights[0] / scale[0];
    model.per_mm2 = weights[1] / scale[1];
    model.per_mm5 = weights[2] / scale[2];
    std::size_t at = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) model.spread[at++] = inverse(i, j) / (scale[i] * scale[j]);
    }
    best = std::move(fit);
  }
  best.model.threshold_mm = threshold_mm;
  best.model.sharpen_steps = sharpen_steps;
  best.model.pairs = static_cast<int>(pairs.size());
  const auto [least, most] = std::ranges::minmax(pairs, {}, &Pair::newtons);
  best.model.from_n = least.newtons;
  best.model.to_n = most.newtons;
  return best;
}

}  // namespace dtact::force
