#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tests/accuracy/whole/scene_judge.hpp"

namespace dtact::whole {

/// Statistics of many values of one kind.
struct Distribution {
  std::size_t count = 0;
  double median = 0;
  double p95 = 0;
  double max = 0;
  double above_1 = 0;  ///< Share of values above 1, …
  double above_2 = 0;  ///< … and above 2, in units of the stated error.
};

/// Leaves NaN out.
[[nodiscard]] Distribution distribution_of(std::vector<double> values);

/// A quantity of every judged frame: a function of it, or its ratio to the stated uncertainty.
struct Quantity {
  const char* name;
  const char* unit;  ///< "": a ratio to the stated uncertainty.
  double (*value)(const FrameErrors& frame);
};
[[nodiscard]] const std::vector<Quantity>& quantities();
/// The quantity of this name, in frames without a flag. Throws std::out_of_range.
[[nodiscard]] Distribution distribution_of(const std::vector<SceneReport>& scenes,
                                           std::string_view name);

/// Frames that report contact where none exists, and resting contacts that are not reported.
struct ContactMistakes {
  int false_contacts = 0;
  int no_contact_frames = 0;
  int missed = 0;
  int contact_frames = 0;
  int flagged = 0;  ///< Flagged frames, not judged.
};
[[nodiscard]] ContactMistakes contact_mistakes(const std::vector<SceneReport>& scenes);

/// The tables of the page, Markdown.
[[nodiscard]] std::string to_markdown(const std::vector<SceneReport>& scenes);
/// A line for each judged frame.
[[nodiscard]] std::string to_csv(const std::vector<SceneReport>& scenes);

}  // namespace dtact::whole
