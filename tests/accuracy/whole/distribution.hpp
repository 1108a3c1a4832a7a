#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tests/accuracy/whole/scene_judge.hpp"

namespace dtact::whole {

/// What many values of one kind are like.
struct Distribution {
  std::size_t count = 0;
  double median = 0;
  double p95 = 0;
  double max = 0;
  double above_1 = 0;  ///< Share of them, …
  double above_2 = 0;  ///< … what is stated being 1.
};

/// NaN are left out.
[[nodiscard]] Distribution distribution_of(std::vector<double> values);

/// A quantity of every judged frame; a function of it or its ratio to what is stated.
struct Quantity {
  const char* name;
  const char* unit;  ///< "": a ratio to what is stated.
  double (*value)(const FrameErrors& frame);
};
[[nodiscard]] const std::vector<Quantity>& quantities();
/// The quantity of this name, in frames without a flag. Throws std::out_of_range.
[[nodiscard]] Distribution distribution_of(const std::vector<SceneReport>& scenes,
                                           std::string_view name);

/// Frames that report contact where there is none, and resting contacts that are not reported.
struct ContactMistakes {
  int false_contacts = 0;
  int no_contact_frames = 0;
  int missed = 0;
  int contact_frames = 0;
  int flagged = 0;  ///< Left out.
};
[[nodiscard]] ContactMistakes contact_mistakes(const std::vector<SceneReport>& scenes);

/// The tables of the page, Markdown.
[[nodiscard]] std::string to_markdown(const std::vector<SceneReport>& scenes);
/// A line for each judged frame.
[[nodiscard]] std::string to_csv(const std::vector<SceneReport>& scenes);

}  // namespace dtact::whole
