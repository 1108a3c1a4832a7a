#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/accuracy/table/table.hpp"

namespace dtact::model_study {

/// Errors of one method of the paper's table on objects, a value each seed, mm.
struct ObjectErrors {
  /// By object: mean absolute error against the simulator's indentation in contact.
  std::vector<std::vector<double>> in_contact_mm;
  std::vector<double> no_contact_mm;  ///< Root mean square of one frame's map.
  int refused = 0;                    ///< Seeds whose press was not taken.

  [[nodiscard]] double object_mm(std::size_t object) const;  ///< Mean over the seeds.
  [[nodiscard]] double mean_mm() const;                      ///< And over the objects.
};

/// config/scenes/all_objects.toml's objects, each as it is held.
[[nodiscard]] std::vector<std::string> object_names();
/// Every method of the paper's table, calibrated for each of the seeds 1 … `seeds` as the table
/// does it, on a sensor of the law.
[[nodiscard]] std::vector<ObjectErrors> read_objects(int seeds,
                                                     table::Law law = table::Law::built_in);
/// The table, Markdown; `sensor` says in a word or two what was pressed.
[[nodiscard]] std::string to_markdown(const std::vector<ObjectErrors>& errors, int seeds,
                                      const std::string& sensor);

}  // namespace dtact::model_study
