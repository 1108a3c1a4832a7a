// Runs the simulator through a study of real sensors and prints its figures beside the study's.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/study/figures.hpp"
#include "tests/accuracy/study/rows.hpp"
#include "tests/accuracy/study/study.hpp"

int main(int argc, char** argv) {
  try {
    CLI::App app("The simulator through a study of real sensors");
    std::filesystem::path out;
    app.add_option("--out", out, "Folder of study.csv and study.md; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    using namespace dtact::study;
    std::vector<Result> results;
    std::vector<std::string> laws;
    for (const double gel : figures::kGelThicknesses_mm) {
      const std::vector<Specimen> all = specimens(gel);
      // The other law has contacts of its own; it is pressed upright only.
      for (auto& result : measure({all[0], all[1], all[2]})) results.push_back(std::move(result));
      for (auto& result : measure({all[3]}, {.tilts_deg = {}}))
        results.push_back(std::move(result));
      fmt::print(stderr, "gel of {} mm done\n", gel);
    }
    for (const Specimen& specimen : specimens(figures::kGelThicknesses_mm[1]))
      laws.push_back(specimen.law);
    const std::string markdown = to_markdown(compare(results), laws);
    fmt::print("{}", markdown);
    if (!out.empty()) {
      dtact::base::write_file_atomically(out / "study.csv", to_csv(results));
      dtact::base::write_file_atomically(out / "study.md", markdown);
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "robot_study: {}\n", e.what());
    return 1;
  }
}
