// Finest groove against greatest depth for gels of 1 to 3 mm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

int main(int argc, char** argv) {
  try {
    CLI::App app("Finest groove against greatest depth, by the gel's thickness");
    std::filesystem::path out;
    app.add_option("--out", out, "Folder of thickness.csv; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    std::vector<dtact::thickness::Result> results;
    results.reserve(dtact::thickness::kThicknesses.size());
    for (const double mm : dtact::thickness::kThicknesses) {
      results.push_back(dtact::thickness::measure(mm));
    }
    const auto csv = dtact::thickness::to_csv(results);
    fmt::print("{}", csv);
    if (!out.empty()) dtact::base::write_file_atomically(out / "thickness.csv", csv);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "gel_thickness: {}\n", e.what());
    return 1;
  }
}
