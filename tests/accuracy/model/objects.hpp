#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/accuracy/table/table.hpp"

namespace dtact::model_study {

/// Errors of one method of the paper's table on objects, a value per seed, mm.
struct ObjectErrors {
  /// By object: mean absolute error against the simulator's indentation in contact.
  std::vector<std::vector<double>> in_contact_mm;
  std::vector<double> no_contact_mm;  ///< Root mean square of one frame's map.
  int refused = 0;                    ///< Seeds whose press was refused.

  [[nodiscard]] double object_mm(std::size_t object) const;  ///< Mean over the seeds.
  [[nodiscard]] double mean_mm() const;                      ///< Mean over seeds and objects.
};

/// The objects of config/scenes/all_objects.toml, in the order in which they are held.
[[nodiscard]] std::vector<std::string> object_names();
/// Calibrates every method of the paper's table for each of the seeds 1 … `seeds`, like the table,
/// on a sensor of the law, and measures objects. Without calibration presses it calibrates only the
/// methods of one press; the errors of the others stay empty.
[[nodiscard]] std::vector<ObjectErrors> read_objects(int seeds,
                                                     table::Law law = table::Law::built_in,
                                                     const table::Protocol& protocol = {
                                                         .test_presses = 0});
/// The table, Markdown; `sensor` names the sensor in a word or two.
[[nodiscard]] std::string to_markdown(const std::vector<ObjectErrors>& errors, int seeds,
                                      const std::string& sensor);

}  // namespace dtact::model_study
