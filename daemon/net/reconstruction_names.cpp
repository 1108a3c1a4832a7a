#include "daemon/net/reconstruction_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

using Words = std::vector<std::pair<std::string, int>>;
using pipeline::ReconstructionRules;

const Words& resolutions() {
  static const Words words(pipeline::kResolutionNames.begin(), pipeline::kResolutionNames.end());
  return words;
}

const Words& sharpenings() {
  static const Words words = [] {
    Words all(pipeline::kSharpenNames.begin(), pipeline::kSharpenNames.end());
    for (const int steps : {1, 2}) all.emplace_back(std::to_string(steps), steps);
    return all;
  }();
  return words;
}

std::string word_of(const Words& words, int value) {
  const auto found = std::ranges::find(words, value, &Words::value_type::second);
  return found == words.end() ? "" : found->first;
}

/// The sentence that says what is wrong.
std::string read(const Words& words, std::string_view field, const std::string& word, int& value) {
  const auto found = std::ranges::find(words, word, &Words::value_type::first);
  if (found == words.end()) {
    std::string known;
    for (const auto& entry : words) known += (known.empty() ? "" : ", ") + entry.first;
    return fmt::format("set_reconstruction.{}: \"{}\" is unknown; known are {}", field,
                       base::first_bytes(word, wire::kMaxCalibrationName), known);
  }
  value = found->second;
  return {};
}

}  // namespace

std::string change(const v1::SetReconstruction& request, ReconstructionRules& rules) {
  ReconstructionRules changed = rules;
  std::string wrong;
  if (request.has_resolution()) {
    wrong = read(resolutions(), "resolution", request.resolution(), changed.decimation);
  }
  if (wrong.empty() && request.has_sharpen()) {
    wrong = read(sharpenings(), "sharpen", request.sharpen(), changed.sharpen);
  }
  if (wrong.empty() && request.has_max_error_um()) {
    changed.max_error_um = request.max_error_um();
    // NaN is neither.
    if (!(changed.max_error_um >= ReconstructionRules::kMinErrorUm &&
          changed.max_error_um <= ReconstructionRules::kMaxErrorUm)) {
      wrong = fmt::format("set_reconstruction.max_error_um: {}; allowed are {} to {}",
                          changed.max_error_um, ReconstructionRules::kMinErrorUm,
                          ReconstructionRules::kMaxErrorUm);
    }
  }
  if (wrong.empty()) rules = changed;
  return wrong;
}

void fill(const ReconstructionRules& rules, v1::Reconstruction& out) {
  out.set_resolution(word_of(resolutions(), rules.decimation));
  out.set_sharpen(word_of(sharpenings(), rules.sharpen));
  out.set_max_error_um(rules.max_error_um);
}

}  // namespace dtact::net
