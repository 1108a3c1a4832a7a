// Prints the errors of every method of the paper's table on objects of many shapes, or writes the
// page.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/model/objects.hpp"

int main(int argc, char** argv) {
  try {
    CLI::App app("Objects of many shapes, read by calibrations from presses of a ball");
    int seeds = 10;
    std::filesystem::path out;
    app.add_option("--seeds", seeds, "Repetitions")->check(CLI::Range(1, 100));
    app.add_option("--out", out, "Folder of objects.md; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    using dtact::table::Law;
    const auto page_of = [&](Law law, const char* sensor) {
      return dtact::model_study::to_markdown(dtact::model_study::read_objects(seeds, law), seeds,
                                             sensor);
    };
    const std::string page = page_of(Law::built_in, "gel of 2 mm") + "\n" +
                             page_of(Law::another, "of another law of gel and light, 2.5 mm");
    fmt::print("{}", page);
    if (!out.empty()) dtact::base::write_file_atomically(out / "objects.md", page);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "model_objects: {}\n", e.what());
    return 1;
  }
}
