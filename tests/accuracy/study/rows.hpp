#pragma once

#include <span>
#include <string>
#include <vector>

#include "tests/accuracy/study/study.hpp"

namespace dtact::study {

/// One figure of the study beside the simulator's.
struct Row {
  std::string what;
  std::string study;
  std::vector<std::string> simulated;  ///< By law; "–" where it was not pressed.
  bool agrees = false;                 ///< The first law's figure is within the study's spread.
  std::string remark;                  ///< Known reason for a difference.
};

/// `results` of the gels of 1, 2 and 3 mm, each with the same laws; at least one.
[[nodiscard]] std::vector<Row> compare(const std::vector<Result>& results);

/// One table; remarks only where a row disagrees.
[[nodiscard]] std::string to_markdown(std::span<const Row> rows, std::span<const std::string> laws);

}  // namespace dtact::study
