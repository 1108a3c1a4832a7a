#include "clients/perceive/recognition/recogniser.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <span>
#include <stdexcept>

#include "clients/perceive/recognition/taught_objects.hpp"

asm(".pushsection .rodata\n.balign 16\ndtact_model:\n.incbin \"" DTACT_MODEL
    "\"\ndtact_model_end:\n.popsection\n");
extern const char model_begin[] asm("dtact_model");
extern const char model_end[] asm("dtact_model_end");

namespace dtact::perceive {
namespace {

/// Least probability of a known object's name.
constexpr double kSure = 0.6;
/// Least probability of another shape for "unknown".
constexpr double kOther = 0.5;
/// The same of a contact that is cut off.
constexpr double kSurelyOther = 0.95;

Probabilities softmax(std::span<const double, kClasses + 1> scores) {
  Probabilities out;
  const double most = *std::ranges::max_element(scores);
  std::ranges::transform(scores, out.begin(), [&](double s) { return std::exp(s - most); });
  const double sum = std::accumulate(out.begin(), out.end(), 0.0);
  for (double& p : out) p /= sum;
  return out;
}

}  // namespace

Network::Network()
    : net_(cv::dnn::readNetFromONNX(model_begin,
                                    static_cast<std::size_t>(model_end - model_begin))) {}

std::string_view Network::hash() { return DTACT_MODEL_SHA256; }

Network::Output Network::run(const TouchMap& map) {
  const std::array<int, 4> size = {1, 1, TouchMap::kSide, TouchMap::kSide};
  const cv::Mat input(static_cast<int>(size.size()), size.data(), CV_32F,
                      const_cast<float*>(map.mm.data()));
  net_.setInput(input);
  const cv::Mat row = net_.forward();
  if (row.total() <= kClasses + 1) throw std::runtime_error("the recognition's network is damaged");
  const float* values = row.ptr<float>();
  std::array<double, kClasses + 1> scores{};
  std::copy_n(values, scores.size(), scores.begin());
  Output output;
  output.probabilities = softmax(scores);
  output.features.assign(values + scores.size(), values + row.total());
  const float length = std::sqrt(std::inner_product(output.features.begin(), output.features.end(),
                                                    output.features.begin(), 1e-12F));
  for (float& feature : output.features) feature /= length;
  return output;
}

void Evidence::add(const TouchMap& map, const Network::Output& output) {
  constexpr double kDeeper = 1.15;   // shows more: begins again
  constexpr double kLifting = 0.75;  // shows less
  if (map.deepest_mm > kDeeper * now_.deepest_mm) {
    now_ = {};
    now_.deepest_mm = map.deepest_mm;
  }
  if (map.deepest_mm < kLifting * now_.deepest_mm) return;
  now_.features.resize(output.features.size());
  for (std::size_t i = 0; i < now_.log_sum.size(); ++i) {
    now_.log_sum[i] += std::log(std::max(output.probabilities[i], 1e-6));
  }
  for (std::size_t i = 0; i < now_.features.size(); ++i) now_.features[i] += output.features[i];
  ++now_.frames;
  now_.cut = map.cut;
}

void Evidence::release() {
  if (now_.deepest_mm >= TouchMap::kMinDeepestMm) before_.push_back(now_);
  if (before_.size() > kMaxPresses) before_.pop_front();
  now_ = {};
}

void Evidence::forget() {
  now_ = {};
  before_.clear();
}

std::vector<double> Evidence::taught_probabilities(const std::vector<const Press*>& presses) const {
  std::vector<double> out;
  if (!taught_) return out;
  for (const TaughtObject& object : *taught_) {
    double share = 0;  // of the radius
    for (const Press* press : presses) {
      std::vector<float> mean = press->features;
      const double length =
          std::sqrt(std::inner_product(mean.begin(), mean.end(), mean.begin(), 1e-12));
      for (float& value : mean) value = static_cast<float>(value / length);
      share += nearest(object, mean) / object.radius / static_cast<double>(presses.size());
    }
    // 1 where a taught press is met, kSure at the radius.
    out.push_back(share <= 1 ? 1 - (1 - kSure) * share : 0);
  }
  return out;
}

Recognised Evidence::result(int presses) const {
  Recognised found;
  if (now_.frames == 0) return found;
  std::vector<const Press*> joined;
  const bool shallow = now_.deepest_mm < TouchMap::kMinDeepestMm;
  if (!shallow) {
    joined.push_back(&now_);
    for (auto press = before_.rbegin();
         press != before_.rend() && static_cast<int>(joined.size()) < presses; ++press) {
      joined.push_back(&*press);
    }
  }
  found.presses = static_cast<int>(joined.size());
  if (joined.empty()) joined.push_back(&now_);
  Probabilities sum{};
  for (const Press* press : joined) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += press->log_sum[i] / press->frames;
  }
  found.probabilities = softmax(sum);

  const std::vector<double> taught = taught_probabilities(joined);
  const double best_taught = taught.empty() ? 0 : *std::ranges::max_element(taught);
  for (std::size_t i = 0; i < taught.size(); ++i) {
    if (taught[i] > 0) found.candidates.push_back({(*taught_)[i].name, taught[i], true});
  }
  for (std::size_t i = 0; i < kClasses; ++i) {
    found.candidates.push_back(
        {std::string(kClassNames.at(i)), (1 - best_taught) * found.probabilities.at(i), false});
  }
  std::ranges::stable_sort(found.candidates, std::greater(), &Recognised::Candidate::probability);

  if (found.presses == 0) {
    found.verdict = Verdict::too_shallow;
  } else if (found.candidates.front().probability >= kSure) {
    found.verdict = Verdict::known;
  } else if (now_.cut > TouchMap::kMaxCut && found.probabilities.back() < kSurelyOther) {
    found.verdict = Verdict::cut_off;
  } else {
    found.verdict = found.probabilities.back() >= kOther ? Verdict::unknown : Verdict::unsure;
  }
  found.score = std::max(best_taught, 1 - found.probabilities.back());
  return found;
}

}  // namespace dtact::perceive
