#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "tests/accuracy/atlas/run.hpp"

namespace dtact::atlas {

/// One disturbance, swept from harmless to broken.
struct Row {
  std::string_view group;  ///< light, image, scene or reference: its picture.
  std::string_view id;     ///< Names its lines in the CSV.
  std::string_view title;
  std::string_view unit;       ///< Unit of the swept value.
  std::vector<double> values;  ///< The first is harmless; its error is nominal.
  std::function<Script(double)> script;
  /// The reason why one luma image cannot show this disturbance; empty where it can. See the page.
  std::string_view undecidable;
};

/// Every row of the atlas: those of its groups, each in a file of its name.
[[nodiscard]] std::vector<Row> rows();
[[nodiscard]] std::vector<Row> light_rows();
[[nodiscard]] std::vector<Row> image_rows();
[[nodiscard]] std::vector<Row> scene_rows();
[[nodiscard]] std::vector<Row> reference_rows();

/// Scenes without a disturbance: every flag in them is false.
[[nodiscard]] std::vector<Script> clean_scripts();

}  // namespace dtact::atlas
